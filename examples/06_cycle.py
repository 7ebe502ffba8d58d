"""Parts a minute by what the motors are rated for.

The fastest motions, one after the other, are no answer: motors that give their peak all the time
overheat. So all legs of a cycle are planned together, each as fast as the motors' RMS torque over
the period pays for.
"""

from pathlib import Path

import deltaopt

ROBOT = Path(__file__).parents[1] / "problems/robots/industrial.yaml"
PICK, PLACE = (0.85, -0.1525, 0.0), (0.85, 0.1525, 0.0)  # m


def cycle(robot):
    """There with 1 kg and back without it, 50 ms at either end."""
    there = deltaopt.Scene(robot=robot, payload=1.0, start=PICK, goal=PLACE)
    back = deltaopt.Scene(robot=robot, start=PLACE, goal=PICK)
    return deltaopt.Cycle(legs=(there, back), dwells=(0.05, 0.05))


def main():
    robot = deltaopt.load_robot(ROBOT)
    for rated in (15.0, 25.0, 35.0):
        drive = robot.drive.model_copy(update={"rms_torque": rated})
        plan = deltaopt.plan_cycle(cycle(robot.model_copy(update={"drive": drive})))
        rms = ", ".join(f"{each:.1f}" for each in plan.rms_torque)
        print(f"rated {rated} N·m: {plan.parts_per_minute:.0f} parts a minute, RMS {rms} N·m")


if __name__ == "__main__":
    main()
