"""What is optimised: a scene is compiled into a problem, once."""
