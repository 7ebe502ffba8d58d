"""report.html: what it says, what it draws, and that it needs and admits nothing from outside."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from html.parser import HTMLParser
from math import inf
from pathlib import Path

import numpy as np
import pytest

from deltaopt import plan_cycle
from deltaopt.cli import main
from deltaopt.motion.active_limits import AT_LIMIT, active_limits, share_curves
from deltaopt.output.cycle_files import verified
from deltaopt.output.facts import Facts, facts
from deltaopt.planning.first_motions.around_bodies import CLEAR
from deltaopt.planning.first_motions.initial_motion import baseline
from deltaopt.planning.journal import Entry
from deltaopt.planning.plan import Optimum, TakenWay, plan_as_it_is
from deltaopt.problem.of_scene import problem_of
from deltaopt.report.page import cycle_report, report
from deltaopt.scene.bodies import Body
from deltaopt.scene.scene_file import load_cycle, load_scene
from deltaopt.verify.verification import verify
from studies.problems import PROBLEMS

SCENE = load_scene(PROBLEMS / "pick_and_place.yaml")
TRICK = "</script><script>document.title='taken'</script><img src=x onerror=alert(1)>&\"'"


class Text(HTMLParser):
    """Collects the text between tags, the tags, and the embedded JSON."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.words: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attributes)))

    def handle_data(self, data: str) -> None:
        self.words.append(data)

    def __str__(self) -> str:
        return " ".join(" ".join(self.words).split())


def of_line(scene, line) -> Facts:
    """What is told of a straight line."""
    return facts(plan_as_it_is(scene, line, inf, None, "straight line"))


@pytest.fixture(scope="module")
def planned(picked):
    return picked, verify(SCENE, picked.trajectory)


@pytest.fixture(scope="module")
def page(planned, tmp_path_factory) -> Path:
    found, verification = planned
    file = tmp_path_factory.mktemp("report") / "report.html"
    file.write_text(report(Facts(found, verification)), encoding="utf-8")
    return file


def embedded(page: str) -> dict:
    return json.loads(re.search(r'<script type="application/json".*?>(.*?)</script>', page)[1])


def test_the_page_of_a_cycle_plays_the_whole_period():
    """Legs and dwells in turn: frames and curves are those of the cycle's trajectory, and the
    bodies of every leg are drawn."""
    cycle = load_cycle(PROBLEMS / "cycles" / "there_and_back.yaml")
    body = Body.model_validate({"sphere": {"centre": (0.6, 0.0, 0.0), "radius": 0.02}})
    back = cycle.legs[1].model_copy(update={"keep_out": (body,)})
    cycle = cycle.model_copy(update={"legs": (cycle.legs[0], back)})
    found = plan_cycle(cycle, tolerance=1e-3)
    text = cycle_report(found, verified(found))
    drawn = embedded(text)
    t, motion = np.array(drawn["frames"]["t"]), found.trajectory(drawn["frames"]["t"])
    assert drawn["duration"] == pytest.approx(found.period, rel=1e-12)
    assert np.array(drawn["frames"]["x"]) == pytest.approx(motion.x, abs=1e-6)
    (torque,) = (
        each
        for each in drawn["curves"]["of"]
        if (each["limit"], each["subject"]) == ("torque", "motor 2")
    )
    instants = np.array(drawn["curves"]["t"])
    inside = np.append(np.diff(instants) > 1e-6, False)[1:] & (np.diff(instants) > 1e-6)
    at = instants[1:][inside]
    given = found.trajectory(at).tau[:, 1] / 40.0
    assert np.array(torque["values"])[1:][inside] == pytest.approx(given, abs=2e-3)
    assert [body["radius"] for body in drawn["bodies"]] == [0.02]
    (near,) = drawn["clearance"]["of"]
    there = np.array([value is None for value in near["values"]])  # no body on the way there
    assert there[instants < found.phases[0] - 1e-6].all()
    assert not there[instants > found.phases[0] + found.phases[1] + 1e-6].any()
    spans = [span for each in drawn["active"] for span in each["spans"]]
    assert max(span[1] for span in spans) > found.phases[0] + found.phases[1]
    assert str(Text(text)).count("parts per minute") == 2
    assert t[-1] == pytest.approx(found.period, abs=1e-6)


# What limits a motion


def test_signed_shares_of_torques_are_torques_over_their_limit(planned):
    trajectory = planned[0].trajectory
    inside = np.linspace(0, 1, 7)
    curves = share_curves(problem_of(SCENE), trajectory, inside)
    assert list(curves) == [("torque", f"motor {k}") for k in (1, 2, 3)]
    tau = trajectory.inside_intervals(inside).tau
    np.testing.assert_allclose(np.array(list(curves.values())).T, tau / 10.0, atol=1e-12)


def test_time_at_limits_is_that_of_dense_samples(planned):
    trajectory = planned[0].trajectory
    t = np.linspace(0, trajectory.duration, 200_001)[1:-1]
    at = np.abs(trajectory(t).tau / 10.0) >= AT_LIMIT
    found = {each.subject: each for each in active_limits(problem_of(SCENE), trajectory)}
    for k in range(3):
        each = found[f"motor {k + 1}"]
        assert each.share == pytest.approx(at[:, k].mean(), abs=2e-3)
        for span in each.spans:
            inside = (t > span.begin + 1e-4) & (t < span.end - 1e-4)
            sign = 1 if span.upper else -1
            assert (sign * trajectory(t[inside]).tau[:, k] / 10.0 > 0.98).all()
        assert sum(s.end - s.begin for s in each.spans) == pytest.approx(
            each.share * trajectory.duration
        )


def test_a_slow_motion_is_at_no_limit():
    assert active_limits(problem_of(SCENE), baseline(SCENE).slowed(2.0)) == ()
    text = report(of_line(SCENE, baseline(SCENE).slowed(2.0)))
    assert "No limit is reached for a noticeable part of the time." in text


# What the page says


def test_the_command_writes_it(tmp_path, capsys):
    scene = str(PROBLEMS / "pick_and_place.yaml")
    assert main(["plan", scene, "--baseline", "--report", "--no-plot", "-o", str(tmp_path)]) == 0
    names = sorted(file.name for file in tmp_path.iterdir())
    assert names == ["plan.json", "report.html", "trajectory.csv"]
    assert "report.html" in capsys.readouterr().out


def test_it_says_what_was_found(planned, page):
    found, verification = planned
    text = str(Text(page.read_text(encoding="utf-8")))
    assert f"{found.duration:.3f} s, {30 / found.duration:.0f} parts per minute" in text
    assert "150 mm from [0.45, -0.05, 0] to [0.45, 0.1, 0] m, with 1 kg" in text
    for check in verification.checks():
        assert check.measure.replace("_", " ") in text
    for each in verification.duty.motors:
        assert f"{each.rms_torque:.4g}" in text
    for each in verification.distances:
        assert each.name in text
    for word in ("payload", "gravity", "elasticity", "play in joints"):
        assert word in text
    assert "Motor 1's torque is at its limit" in text


def test_nothing_reads_like_a_failure_when_all_is_well(page):
    whole = page.read_text(encoding="utf-8")
    told = str(Text(whole[whole.index("<body>") : whole.index("<script")])).lower()
    for word in ("fail", "not met", "error:", "warning", "violat", "exceeds"):
        assert word not in told


def test_a_failed_verification_is_told():
    text = str(Text(report(of_line(SCENE, baseline(SCENE).slowed(0.99)))))
    assert "Verification failed: torque of motor 1 exceeds its limit" in text


def test_names_cannot_write_html(planned):
    robot = SCENE.robot.model_copy(update={"name": TRICK})
    scene = SCENE.model_copy(update={"robot": robot})
    found, verification = planned
    text = report(Facts(replace(found, scene=scene), verification))
    tags = [tag for tag, _ in Text(text).tags]
    assert "img" not in tags
    assert tags.count("script") == 2
    assert TRICK.replace("</script>", "") not in text


def test_nothing_is_loaded(page):
    text = page.read_text(encoding="utf-8")
    for _, attributes in Text(text).tags:
        for name in ("src", "href", "action", "data"):
            assert (attributes.get(name) or "data:").startswith("data:")
    assert "default-src 'none'" in text
    assert re.findall(r"url\(|@import|fetch\(|XMLHttpRequest|import\(|eval\(", text) == []
    assert len(text) < 200_000


def test_embedded_frames_are_the_motion(planned, page):
    data, trajectory = embedded(page.read_text(encoding="utf-8")), planned[0].trajectory
    motion = trajectory(np.linspace(0, trajectory.duration, len(data["frames"]["t"])))
    np.testing.assert_allclose(data["frames"]["t"], motion.t, rtol=0, atol=1e-7)
    np.testing.assert_allclose(data["frames"]["x"], motion.x, rtol=0, atol=1e-7)
    np.testing.assert_allclose(data["frames"]["theta"], motion.theta, rtol=0, atol=1e-7)


# Bodies, via points, other ways

BODIES = [
    {"sphere": {"centre": (0.87, 0.0, 0.02), "radius": 0.02}},
    {"box": {"from": (0.86, -0.05, -0.06), "to": (0.9, 0.05, -0.02)}},
    {"cylinder": {"from": (0.87, 0.1, 0.05), "to": (0.9, 0.1, 0.05), "radius": 0.01}},
    {"half_space": {"point": (0.95, 0, 0), "normal": (1, 0, 0)}},
    {"hull": {"points": [(0.9, 0, 0), (0.92, 0, 0), (0.9, 0.02, 0), (0.9, 0, 0.02)]}},
]
NARROW = load_scene(PROBLEMS / "via" / "within.yaml").model_copy(update={"keep_out": BODIES})


OVER = ("above keep_out[0]", 0.1234567, True)
UNDER = ("below keep_out[0]", 0.2, False)
OPTIMUM = Optimum(0.1, 0.1, (0.45, 0.0, 0.0), 1e-4, 1)


@pytest.mark.parametrize(
    ("ways", "optima", "says"),
    [
        ((), (), "Motions that lead another way were not compared."),
        ((OVER, UNDER, UNDER), (), "It was compared with 2 other ways past the bodies."),
        ((OVER,), (), "No other way past the bodies was found."),
        (((CLEAR, 0.1, True),), (), "It keeps clear of all bodies without a detour."),
        ((), (OPTIMUM, OPTIMUM), "It was compared with one other local optimum."),
    ],
)
def test_it_says_with_what_it_was_compared(planned, ways, optima, says):
    found, verification = planned
    taken = tuple(TakenWay(*way, found.trajectory) for way in ways)
    found = replace(found, ways=taken, optima=optima)
    text = str(Text(report(Facts(found, verification))))
    assert says in text
    assert ("not compared" in text) == ("not compared" in says)
    several = len(ways) > 1
    assert ("Ways past the bodies" in text) == several
    if several:
        assert "above keep_out[0] 0.1235 s taken below keep_out[0] about 0.200 s" in text


def test_what_was_attempted_is_told_where_it_was_more_than_once(planned):
    found, verification = planned
    assert "What was attempted" not in str(Text(report(Facts(found, verification))))
    tried = Entry("the way <below>", "0.3 s, 16 intervals", "no motion", None, 4)
    found = replace(found, journal=(*found.journal, "once more:", tried))
    text = str(Text(report(Facts(found, verification))))
    assert "once more: the way <below>, 0.3 s, 16 intervals: no motion (4 meshes)" in text


def test_bodies_are_told_and_collisions_with_others_are_not_modelled(planned):
    text = str(Text(report(of_line(NARROW, baseline(NARROW)))))
    assert "Bodies are grey" in text
    assert "Diamonds are via points" in text
    assert "collisions with anything but the bodies of the scene" in text
    found, verification = planned
    plain = str(Text(report(Facts(found, verification))))
    assert "Bodies are grey" not in plain
    assert "Diamonds" not in plain


def test_distances_from_bodies_are_those_of_their_shapes():
    """In mm; the tool is a point, whose distances from a sphere and a plane are known."""
    line = baseline(NARROW)
    drawn = embedded(report(of_line(NARROW, line)))
    assert drawn["clearance"]["asked"] == [1e3 * NARROW.least_clearance]
    near = {each["subject"]: each for each in drawn["clearance"]["of"]}
    assert len(near) == len(BODIES)
    x = 1e3 * line(np.array(drawn["curves"]["t"])).x
    sphere = np.linalg.norm(x - 1e3 * np.array([0.87, 0.0, 0.02]), axis=1) - 20
    found = near["keep_out[0], a sphere"]
    assert found["values"] == pytest.approx(sphere, abs=2e-3)
    assert found["least"] == pytest.approx(sphere.min(), abs=0.1)
    assert near["keep_out[3], a half-space"]["values"] == pytest.approx(950 - x[:, 0], abs=2e-3)


def test_durations_are_compared_as_in_the_picture(planned):
    """What is compared with the motion are the straight lines that keep the scene."""
    found, verification = planned
    told = Facts(found, verification)
    text = str(Text(report(told)))
    best = min(told.straight_lines.values())
    assert f"{100 * (1 - found.duration / best):.2g} % less time than the line" in text
    for duration in (*told.straight_lines.values(), found.duration):
        assert f"{duration:.4f} s" in text
    assert text.index("Duty of the motors") < text.index("Verification Each")
    assert "less time" not in str(Text(report(of_line(NARROW, baseline(NARROW)))))


# In a browser


CHROMIUM = next(
    filter(
        None,
        map(
            shutil.which,
            ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome"),
        ),
    ),
    None,
)


@pytest.fixture(scope="module")
def browser():
    playwright = pytest.importorskip(
        "playwright.sync_api", reason="no playwright: pip install -e '.[browser]'"
    )
    if CHROMIUM is None:
        pytest.skip("no Chromium on this machine: report.html is not tried in a browser")
    with playwright.sync_playwright() as started:
        chromium = started.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield chromium
        chromium.close()


class Opened:
    """The page in a browser, with everything that its console said and all that it asked for."""

    def __init__(self, browser, file: Path, width: int = 1280) -> None:
        self.page = browser.new_page(viewport={"width": width, "height": 900})
        self.said: list[str] = []
        self.asked: list[str] = []
        self.page.on("console", lambda message: self.said.append(message.text))
        self.page.on("pageerror", lambda error: self.said.append(str(error)))
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.goto(file.as_uri())

    def numbers(self, element: str, *names: str) -> np.ndarray:
        found = [self.page.locator(element).first.get_attribute(name) for name in names]
        return np.array(found, dtype=float)

    def frame(self) -> int:
        return int(self.page.locator("#time").input_value())

    def wait_until(self, holds):
        """Wait for what the page does by itself: its own rules forbid it to evaluate a text."""
        for _ in range(200):
            if holds():
                return
            self.page.wait_for_timeout(25)
        pytest.fail("waited in vain")

    def go_to(self, frame: int) -> None:
        self.page.locator("#time").fill(str(frame))


def test_the_robot_is_drawn_where_it_is(browser, planned, page):
    """In the front view coordinates are y and x of the base's frame, mm: up is up."""
    opened, trajectory = Opened(browser, page), planned[0].trajectory
    opened.page.locator("[data-view=front]").click()
    robot, seen = SCENE.robot, []
    for frame in (0, 100, 277, 400):
        opened.go_to(frame)
        motion = trajectory(trajectory.duration * frame / 400)
        tool = opened.numbers("#tool", "cx", "cy")
        np.testing.assert_allclose(tool, 1e3 * motion.x[[1, 0]], atol=2e-3)
        for k, azimuth in enumerate(np.deg2rad([0, 120, 240])):
            theta = motion.theta[k]
            out = robot.base_radius + robot.upper_arm.length * np.cos(theta)
            elbow = 1e3 * np.array([np.cos(azimuth) * out, -robot.upper_arm.length * np.sin(theta)])
            drawn = opened.numbers(f"#arm{k + 1}", "x2", "y2")
            np.testing.assert_allclose(drawn, elbow, atol=2e-3)
        seen.append(tool)
    assert np.ptp(seen, axis=0).min() > 1.0
    assert opened.said == []
    assert opened.asked == [page.as_uri()]
    opened.page.close()


@pytest.fixture(scope="module")
def narrow(tmp_path_factory) -> Path:
    """The page of a motion past bodies of all kinds, with via points."""
    file = tmp_path_factory.mktemp("narrow") / "report.html"
    file.write_text(report(of_line(NARROW, baseline(NARROW))), encoding="utf-8")
    return file


def test_bodies_and_via_points_are_drawn_where_they_are(browser, narrow):
    """In the front view y is to the right and x down, in the view from above z is down."""
    opened = Opened(browser, narrow)
    for view, right, down in (("front", 1, 0), ("top", 1, 2)):
        opened.page.locator(f"[data-view={view}]").click()
        drawn = [opened.page.locator(f"#body{i}") for i in range(1, 6)]

        def extent(i, right=right, down=down, drawn=drawn):
            points = drawn[i].locator("polygon").get_attribute("points")
            return np.ptp(np.array([p.split(",") for p in points.split()], dtype=float), axis=0)

        circle = [float(drawn[0].locator("circle").get_attribute(n)) for n in ("cx", "cy", "r")]
        marks = opened.page.locator(".via circle")
        spheres = [
            [float(marks.nth(i).get_attribute(n)) for n in ("cx", "cy", "r")] for i in (0, 1)
        ]
        expected = [[each.at[right], each.at[down], each.within] for each in NARROW.via]
        # Where the drawing's origin is does not matter: against the first via point.
        shift = np.append(np.subtract(spheres[0][:2], 1e3 * np.array(expected[0][:2])), 0.0)
        np.testing.assert_allclose(spheres, 1e3 * np.array(expected) + shift, atol=2e-3)
        sphere = BODIES[0]["sphere"]
        wanted = [sphere["centre"][right], sphere["centre"][down], sphere["radius"]]
        np.testing.assert_allclose(circle, 1e3 * np.array(wanted) + shift, atol=2e-3)
        ends = np.array([BODIES[1]["box"][end] for end in ("from", "to")])
        np.testing.assert_allclose(extent(1), 1e3 * np.ptp(ends, axis=0)[[right, down]], atol=2e-2)
        np.testing.assert_allclose(extent(4), [20, 20], atol=2e-2)
        assert drawn[1].locator("polyline").count() == 12
        assert drawn[2].locator("polyline").count() == 2
        assert drawn[3].locator("polyline").count() == 1
        assert drawn[3].locator("polygon").get_attribute("points") == ""
    assert drawn[0].locator("title").text_content() == "keep_out[0], a sphere"
    assert opened.said == []
    opened.page.close()


@pytest.mark.parametrize("file", ["approach/25_305_25.yaml", "paths/tube.yaml"])
def test_what_the_path_stays_in_is_drawn_where_it_is(browser, tmp_path, file):
    """In the front view: columns 10 mm wide and 25 mm high above both ends, a tube 10 mm wide that
    begins at the start and rises 25 mm."""
    scene = load_scene(PROBLEMS / file)
    free = scene.model_copy(update={"tube": None, "path": None, "approach": None})
    text = report(of_line(scene, baseline(free)))
    assert "Blue is what the path stays in." in str(Text(text))
    (tmp_path / "report.html").write_text(text, encoding="utf-8")
    opened = Opened(browser, tmp_path / "report.html")
    opened.page.locator("[data-view=front]").click()

    def points(selector):
        given = opened.page.locator(selector).first.get_attribute("points")
        return np.array([point.split(",") for point in given.split()], dtype=float)

    start = 1e3 * np.array([scene.start[1], scene.start[0]])
    goal = 1e3 * np.array([scene.goal[1], scene.goal[0]])
    if scene.tube is None:
        for body, end in (("#body1", start), ("#body2", goal)):
            corners = points(f"{body} polygon")
            np.testing.assert_allclose(np.ptp(corners, axis=0), [10, 25], atol=0.1)
            np.testing.assert_allclose(corners.max(axis=0) - [5, 0], end, atol=0.1)
    else:
        axis, tube = points("#body1 polyline"), opened.page.locator("#body1 polyline")
        np.testing.assert_allclose(axis[[0, -1]], [start, goal], atol=2e-2)
        np.testing.assert_allclose(np.ptp(axis, axis=0), [305, 25], atol=2e-2)
        assert float(tube.get_attribute("stroke-width")) == pytest.approx(10)
        assert tube.get_attribute("vector-effect") == "none"  # in mm, not in pixels
    assert opened.said == []
    opened.page.close()


def test_the_wheel_comes_closer_and_large_bodies_do_not_shrink_the_robot(browser, page, narrow):
    """In both scenes the robot is the same; a table of metres takes a quarter more at most."""

    def seen(opened):
        return float(opened.page.locator("#robot").get_attribute("viewBox").split()[2])

    opened, beside = Opened(browser, page), Opened(browser, narrow)
    scene = load_scene(PROBLEMS / "pick_and_place.yaml")
    lengths = [each.robot.upper_arm.length + each.robot.forearm.length for each in (scene, NARROW)]
    assert seen(beside) / lengths[1] < 1.25 * seen(opened) / lengths[0]
    before = seen(opened)
    opened.page.locator("#robot").hover()
    opened.page.mouse.wheel(0, -200)
    opened.wait_until(lambda: seen(opened) < before)
    assert seen(opened) == pytest.approx(before * np.exp(-0.5), rel=1e-3)
    opened.page.locator("[data-view=side]").click()
    opened.page.locator("[data-view=oblique]").click()
    assert seen(opened) == pytest.approx(before)
    assert opened.said == beside.said == []
    opened.page.close()
    beside.page.close()


def test_charts_tell_what_is_under_the_pointer(browser, planned, page):
    """The values at the pointer's instant; the robot stays where it is. Ticks are round."""
    opened, trajectory = Opened(browser, page), planned[0].trajectory
    box = opened.page.locator("#curves svg[role=img]").first.bounding_box()
    opened.page.mouse.move(box["x"] + 62 + 0.3 * (box["width"] - 74), box["y"] + 60)
    told = opened.page.locator(".tip").inner_text()
    assert told.startswith(f"{300 * trajectory.duration:.1f} ms")
    percents = [float(n.replace("−", "-")) for n in re.findall(r"(−?\d+) %", told)]
    expected = 10 * trajectory(0.3 * trajectory.duration).tau
    np.testing.assert_allclose(percents, expected, atol=3.0)
    assert opened.frame() == 0
    opened.page.mouse.move(5, 5)
    assert not opened.page.locator(".tip").is_visible()
    texts = opened.page.locator("#curves svg[role=img] > text").all_text_contents()
    times = [float(text.removesuffix(" ms")) for text in texts if "%" not in text]
    assert np.diff(times) == pytest.approx(times[1] - times[0])
    assert f"{times[1]:.0e}"[0] in "125"
    opened.page.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_writing_is_seen_on_its_ground(browser, page, scheme):
    """Contrast of text by WCAG's formula: at least 4.5, in charts too."""
    opened = Opened(browser, page)
    opened.page.emulate_media(color_scheme=scheme)

    def luminance(colour):
        c = np.array([int(n) for n in re.findall(r"\d+", colour)[:3]]) / 255
        linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
        return linear @ [0.2126, 0.7152, 0.0722]

    def style(element, name):
        return opened.page.locator(element).first.evaluate(f"e => getComputedStyle(e).{name}")

    ground = luminance(style("body", "backgroundColor"))
    inks = [
        style("h1", "color"),
        style("#curves svg[role=img] > text", "fill"),
        style("#arm1 ~ text", "fill"),
    ]
    assert (ground < 0.2) == (scheme == "dark")
    for ink in map(luminance, inks):
        assert (max(ink, ground) + 0.05) / (min(ink, ground) + 0.05) > 4.5
    opened.page.close()


def test_print_has_no_controls(browser, page):
    opened = Opened(browser, page)
    opened.page.emulate_media(media="print")
    for control in ("#play", "#time", "#pace", ".views", ".hint"):
        assert not opened.page.locator(control).first.is_visible()
    assert opened.page.locator("#now").is_visible()
    opened.page.close()


def test_keys_move_the_time(browser, page):
    opened = Opened(browser, page)
    press = opened.page.keyboard.press
    press("ArrowRight")  # with nothing in focus
    press("ArrowRight")
    press("ArrowLeft")
    assert opened.frame() == 1
    before = opened.numbers("#tool", "cx", "cy")
    opened.page.locator("#time").focus()
    for key in ("ArrowRight", "PageUp", "ArrowLeft"):
        press(key)
    assert opened.frame() > 10
    assert not np.allclose(before, opened.numbers("#tool", "cx", "cy"))
    press("End")
    assert opened.frame() == 400
    assert opened.page.locator("#time").get_attribute("aria-valuetext").endswith("ms")
    press("Home")
    press("Space")
    opened.wait_until(lambda: opened.frame() > 3)
    press("Space")
    stopped = opened.frame()
    opened.page.wait_for_timeout(100)
    assert opened.frame() == stopped
    assert opened.said == []
    opened.page.close()


def test_charts_are_linked_to_the_time(browser, planned, page):
    opened = Opened(browser, page)
    found = []
    for frame in (40, 360):
        opened.go_to(frame)
        found.append([c.get_attribute("x1") for c in opened.page.locator(".cursor").all()])
        text = opened.page.locator("#curves figcaption").first.inner_text()
        told = [float(n.replace("−", "-")) for n in re.findall(r"(−?\d+) %", text)]
        motion = planned[0].trajectory(planned[0].duration * frame / 400)
        np.testing.assert_allclose(told, 10 * motion.tau, atol=2.0)
    assert len(found[0]) == 2
    assert all(a != b for a, b in zip(*found, strict=True))
    box = opened.page.locator("#curves svg[role=img]").first.bounding_box()
    opened.page.mouse.click(box["x"] + box["width"] - 12, box["y"] + 40)
    assert opened.frame() == 400
    spans = opened.page.locator(".span")
    assert spans.count() == sum(
        len(each.spans) for each in active_limits(problem_of(SCENE), planned[0].trajectory)
    )
    opened.page.close()


@pytest.mark.parametrize("width", [360, 800, 1600])
def test_layouts_fit_their_width(browser, page, width):
    opened = Opened(browser, page, width)
    wide = opened.page.evaluate("document.documentElement.scrollWidth")
    assert wide <= width
    charts = opened.page.locator("#curves svg[role=img]").first.bounding_box()
    robot = opened.page.locator("#robot").bounding_box()
    if width < 960:
        assert charts["y"] > robot["y"] + robot["height"]
    else:
        assert charts["x"] > robot["x"] + robot["width"]
    opened.page.close()
