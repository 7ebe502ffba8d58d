"""Long functions in C: what CasADi writes, in parts.

A compiler looks at all values of a function at once for each register that it lacks: a function of
tens of thousands of operations takes it a minute, its parts a few seconds.
"""

from __future__ import annotations

import re

from deltaopt.codegen.simd_c import PART, c_text

_FUNCTION = re.compile(
    r"^static int (?P<name>casadi_f\d+)\((?P<arguments>[^)]*)\) \{\n"
    r"(?P<declared>(?:  casadi_real a[^\n]*;\n)+)(?P<body>(?:  a\d+=[^\n]*\n|  if [^\n]*\n)+)"
    r"  return 0;\n\}\n",
    re.MULTILINE,
)
"""A function that CasADi has written of scalar operations, one a line, on the values a0, a1, …"""
_VALUE = re.compile(r"\ba0*(\d+)\b")


def in_parts(source: str) -> str:
    """C source that CasADi has written, with its long functions in parts that hand on their values
    in memory."""
    return _FUNCTION.sub(_function_in_parts, source)


def _function_in_parts(found: re.Match[str]) -> str:
    name, lines = found["name"], found["body"].splitlines()
    if len(lines) <= PART:
        return found[0]
    lines = [_VALUE.sub(r"a[\1]", line.strip()) for line in lines]
    parts = [lines[k : k + PART] for k in range(0, len(lines), PART)]
    known = "const casadi_real **arg, casadi_real **res, casadi_real *a"
    texts = [c_text(f"{name}_part_{i}({known})", part) for i, part in enumerate(parts)]
    calls = [f"  {name}_part_{i}(arg, res, a);\n" for i in range(len(parts))]
    values = f"  casadi_real a[{len(_VALUE.findall(found['declared']))}];\n"
    whole = f"static int {name}({found['arguments']}) {{\n{values}{''.join(calls)}  return 0;\n}}\n"
    return "".join([*texts, whole])
