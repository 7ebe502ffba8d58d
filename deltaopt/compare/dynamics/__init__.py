"""The paper's models of the Delta: what each costs and errs."""
