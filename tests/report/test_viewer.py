"""The robot in a window of its own: where its lines are, by a server that only notes them."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import numpy as np
import pytest

from deltaopt import baseline, load_scene
from deltaopt.cli import main
from deltaopt.report.viewer import Viewer, lines_of_robot
from studies.problems import PROBLEMS

SCENE = load_scene(PROBLEMS / "industrial_drive.yaml")
LINE = baseline(SCENE)


class Server:
    """Stands for viser's server: remembers what is drawn and the values of its controls."""

    def __init__(self, host, port, label, verbose):
        self.host, self.port, self.drawn, self.stopped = host, port, {}, False
        self.scene = SimpleNamespace(
            set_up_direction=lambda direction: setattr(self, "up", direction),
            add_line_segments=self.draw,
        )
        self.initial_camera = SimpleNamespace()
        control = self.control
        self.gui = SimpleNamespace(
            add_slider=lambda label, least, most, step, initial: control(initial),
            add_checkbox=lambda label, initial_value: control(initial_value),
            add_text=lambda label, initial_value, disabled: control(initial_value),
        )

    def draw(self, name, points, colors, thickness, thickness_units):
        self.drawn[name] = SimpleNamespace(points=points, colors=colors)
        return self.drawn[name]

    def control(self, value):
        return SimpleNamespace(value=value, on_update=lambda call: None)

    def get_port(self):
        return self.port + 1  # the next free one

    def stop(self):
        self.stopped = True


@pytest.fixture
def servers(monkeypatch):
    made = []
    fake = SimpleNamespace(ViserServer=lambda **options: made.append(Server(**options)) or made[-1])
    monkeypatch.setitem(sys.modules, "viser", fake)
    return made


def lengths(lines):
    return np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1)


def test_lines_have_the_robots_lengths():
    """Arms and bars, in every configuration, closed at elbows and at the platform."""
    robot = SCENE.robot
    motion = LINE(np.linspace(0, LINE.duration, 7))
    for x, theta in zip(motion.x, motion.theta, strict=True):
        *chains, platform = lines_of_robot(robot, x, theta)
        for lines in chains:
            arm, _, *bars = lengths(lines)
            assert arm == pytest.approx(robot.upper_arm.length, rel=1e-12)
            assert bars == pytest.approx([robot.forearm.length] * 2, rel=1e-9)
            assert lines[1].mean(axis=0) == pytest.approx(lines[0, 1], abs=1e-12)  # the elbow
        tool = platform[-1, 1]
        assert tool == pytest.approx([x[2], x[1], -x[0]], abs=1e-12)  # up is up
        corners = np.concatenate([lines[2:, 1] for lines in chains])
        assert platform[:-1, 0] == pytest.approx(corners, abs=1e-12)


def test_the_slider_shows_an_instant_and_play_moves_on(servers):
    viewer = Viewer(SCENE.robot, LINE, 8080)
    (server,) = servers
    assert (server.host, server.up) == ("127.0.0.1", "+z")
    away = np.subtract(server.initial_camera.position, server.initial_camera.look_at)
    assert np.linalg.norm(away) > SCENE.robot.forearm.length
    assert len({server.drawn[f"/robot/chain{k}"].colors for k in (1, 2, 3)}) == 3
    viewer.show(1.0)
    end = LINE(LINE.duration)
    expected = lines_of_robot(SCENE.robot, end.x, end.theta)
    for name, lines in zip(("chain1", "chain2", "chain3", "platform"), expected, strict=True):
        np.testing.assert_allclose(server.drawn[f"/robot/{name}"].points, lines, atol=1e-6)
    assert viewer.torques.value == ", ".join(f"{tau:.1f}" for tau in end.tau)
    viewer.advance(0.1)
    assert viewer.slider.value == 0.0  # it does not play
    viewer.playing.value = True
    viewer.advance(0.1)
    assert viewer.slider.value == pytest.approx(10.0)  # ms: a tenth of real time
    viewer.advance(100.0)
    assert viewer.slider.value == 0.0  # anew


def test_from_the_command_line(servers, tmp_path, monkeypatch, capsys):
    words = ["plan", "problems/pick_and_place.yaml", "--baseline", "--no-plot", "-o", str(tmp_path)]
    assert main(words) == 0
    capsys.readouterr()

    def stop(seconds):
        raise KeyboardInterrupt

    monkeypatch.setattr("deltaopt.cli.view.sleep", stop)
    assert main(["view", str(tmp_path), "--port", "8100"]) == 130
    assert capsys.readouterr().out == "http://localhost:8101 (Ctrl-C ends it)\n"
    assert servers[0].stopped


def test_without_viser_one_sentence(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "viser", None)
    assert main(["view", str(tmp_path)]) == 1
    said = capsys.readouterr().err
    in_clone = "pip install -e '.[view]' in the clone"
    with_wheel = "pip install 'deltaopt[view]' with a wheel"
    assert said == f"deltaopt: viser is not installed: {in_clone}, or {with_wheel}\n"
