"""Pure mathematics of curves: piecewise polynomials, Bernstein's form, bisection."""
