"""Features of scenes together: which pairs are planned and verified, and which are refused.

Those of compiled code that other tests share; docs/combinations.md has all pairs.
"""

from __future__ import annotations

import pytest

from deltaopt import SceneError, load_scene, plan, verify
from deltaopt.scene.scene import Scene
from studies.problems import PROBLEMS

ROBOT = load_scene(PROBLEMS / "keep_out" / "wall_25_305_25.yaml").robot
PLAIN = {"payload": 1.0, "start": [0.85, -0.1525, 0.0], "goal": [0.85, 0.1525, 0.0]}
OVER = {"pick_and_place": {"height": 0.06, "blend": 0.05}}
END = {"height": 0.02, "radius": 0.005}
FEATURES: dict[str, dict] = {
    "bodies": {"keep_out": [{"box": {"from": [0.80, -0.02, -0.3], "to": [1.5, 0.05, 0.3]}}]},
    "via": {"via": [[0.79, 0.0, -0.03]]},
    "start state": {"start": {"at": [0.85, -0.1525, 0.0], "velocity": [-0.1, 0.3, 0.0]}},
    "goal state": {"goal": {"at": [0.85, 0.1525, 0.0], "velocity": [0.1, 0.3, 0.0]}},
    "belt": {"goal": {"at": [0.85, 0.1525, 0.0], "belt": [0.0, 0.0, 0.3]}},
    "approach": {"approach": {"start": END, "goal": END}},
    "path": {"path": OVER},
    "tube": {"path": OVER, "tube": 0.005},
    "effort": {"objective": "effort", "duration": 0.3},
    "rotation": {"rotation": {"angle": 3.0, "speed": 30.0, "acceleration": 400.0}},
}


def together(*names: str) -> Scene:
    content = PLAIN | {"robot": ROBOT}
    for name in names:
        content |= FEATURES[name]
    return Scene.model_validate(content)


@pytest.mark.parametrize("beside", ["via", "start state", "goal state", "belt", "path", "rotation"])
def test_bodies_beside(beside):
    scene = together("bodies", beside)
    found = plan(scene)
    verified = verify(scene, found.trajectory)
    assert verified.ok, verified.failures()
    assert found.within_tolerance


def test_a_belt_at_rest_past_bodies_is_a_fixed_goal():
    """Ways past bodies are looked for where ends move, too."""
    at_rest, scene = plan(together("bodies")), together("bodies")
    still = {"at": list(scene.goal), "belt": [0.0, 0.0, 0.0]}
    found = plan(scene.model_copy(update={"goal": still}))
    assert found.duration == pytest.approx(at_rest.duration, rel=2e-3)
    assert found.ways[0].name == at_rest.ways[0].name
    assert found.ways[0].duration == found.duration


MOVING = ("start state", "goal state", "belt")


@pytest.mark.parametrize(
    ("one", "other", "key"),
    [
        *((moving, "approach", "approach") for moving in MOVING),
        *((moving, "path", "path") for moving in MOVING),
        *((moving, "effort", "objective") for moving in MOVING),
        *((moving, "rotation", "rotation") for moving in MOVING),
        ("via", "approach", "approach"),
        ("via", "path", "via"),
        ("via", "effort", "objective"),
        ("approach", "path", "approach"),
        ("approach", "effort", "objective"),
        ("path", "effort", "objective"),
        ("tube", "effort", "objective"),
    ],
)
def test_what_is_refused(one, other, key):
    with pytest.raises(SceneError) as refused:
        together(one, other)
    assert refused.value.key == key
