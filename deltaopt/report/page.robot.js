// What is moved, and the robot's drawing, which is turned by dragging.

const plan = JSON.parse(document.getElementById("plan").textContent);
const { robot, frames, curves, active, duration } = plan;
const DASHES = ["", "8 3", "8 3 2 3"];
const last = frames.t.length - 1;
const byId = (id) => document.getElementById(id);
const slider = byId("time"), play = byId("play"), scene = byId("robot");

function make(name, attributes = {}, parent = null, text = "") {
  const element = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text) element.textContent = text;
  if (parent) parent.append(element);
  return element;
}

// Kinematics, in mm. The base's frame: x down, y and z horizontal.

const MM = 1000;
const outward = (k, down, out, aside) => {
  const [c, s] = robot.azimuths[k];
  return [MM * down, MM * (c * out - s * aside), MM * (s * out + c * aside)];
};
const plus = (a, b) => a.map((value, i) => value + b[i]);
const minus = (a, b) => a.map((value, i) => value - b[i]);
const scaled = (a, factor) => a.map((value) => factor * value);
const tool = scaled(robot.tool, MM);

function pose(frame) {
  const point = scaled(frames.x[frame], MM), centre = minus(point, tool);
  const chains = frames.theta[frame].map((theta, k) => {
    const out = robot.base_radius + robot.arm * Math.cos(theta), down = -robot.arm * Math.sin(theta);
    return {
      shaft: outward(k, 0, robot.base_radius, 0),
      elbow: outward(k, down, out, 0),
      bars: [-1, 1].map((side) => [
        outward(k, down, out, side * robot.half_width),
        plus(centre, outward(k, 0, robot.platform_radius, side * robot.half_width)),
      ]),
    };
  });
  return { point, centre, chains };
}

// Views: turned about the robot's middle. In the front view coordinates are y and x of the base's
// frame in mm, x down is down on the screen, and z comes forward.

const poses = frames.t.map((_, frame) => pose(frame));
const path = frames.x.map((x) => scaled(x, MM));
const ends = [plan.start, plan.goal].map((x) => scaled(x, MM));
const bodies = plan.bodies.map((body) => ({
  ...body,
  centre: body.centre && scaled(body.centre, MM),
  radius: MM * body.radius,
  corners: (body.axis ?? body.corners ?? []).map((corner) => scaled(corner, MM)),
  edges: (body.edges ?? []).map((edge) => edge.map((point) => scaled(point, MM))),
}));
const belts = plan.belts.map((way) => way.map((point) => scaled(point, MM)));
const via = plan.via.map(({ at, within }) => ({ at: scaled(at, MM), within: MM * within }));
const VIEWS = { oblique: [0.6, 0.35], front: [0, 0], side: [Math.PI / 2, 0], top: [0, Math.PI / 2] };
let [turn, tilt] = VIEWS.oblique, closeUp = false, now = 0;
// How much closer than all that fits, and where to: in halves of the picture, from its middle.
let zoom = 1, aside = [0, 0];
const within = (value, least, most) => Math.min(most, Math.max(least, value));

function around(points) {
  const middle = [0, 1, 2].map((i) => {
    const along = points.map((point) => point[i]);
    return (Math.min(...along) + Math.max(...along)) / 2;
  });
  return { middle, radius: Math.max(...points.map((point) => Math.hypot(...minus(point, middle)))) };
}
const corners = [0, 0.25, 0.5, 0.75, 1].map((share) => Math.round(share * last)).flatMap((frame) => [
  poses[frame].point,
  ...poses[frame].chains.flatMap((chain) => [chain.shaft, chain.elbow, ...chain.bars.map((bar) => bar[1])]),
]);
const whole = around(corners), close = around([...path, ...ends]);
// What the picture is fitted to: the robot, and of bodies, which may be much larger, what is near it.
const reached = [0, 1, 2].map((i) => [Math.min, Math.max].map((most, k) =>
  most(...corners.map((point) => point[i])) + (2 * k - 1) * 0.1 * whole.radius));
const cell = [...corners, ...bodies.flatMap((body) => body.centre ? [-1, 1].map((side) =>
  body.centre.map((value) => value + side * body.radius)) : body.corners).map((point) =>
  point.map((value, i) => within(value, ...reached[i])))];

function project(point) {
  const [x, y, z] = minus(point, whole.middle);
  const across = Math.cos(turn) * y + Math.sin(turn) * z, away = Math.sin(turn) * y - Math.cos(turn) * z;
  const down = Math.cos(tilt) * x - Math.sin(tilt) * away;
  return [across + whole.middle[1], down + whole.middle[0], Math.cos(tilt) * away + Math.sin(tilt) * x];
}
const at = (point) => project(point).slice(0, 2).map((value) => value.toFixed(3)).join(",");
const along = (points) => points.map(at).join(" ");

const line = { fill: "none", "vector-effect": "non-scaling-stroke", "stroke-linecap": "round", "stroke-linejoin": "round" };
const shade = { ...line, fill: "var(--glass)", "fill-opacity": 0.3, stroke: "var(--soft)", "stroke-width": 1 };
const layers = make("g", {}, scene);
const parts = {
  bodies: bodies.map((body, i) => {
    const group = make("g", { class: "body", id: `body${i + 1}` }, layers);
    make("title", {}, group, body.name);
    const [fill, stroke] = body.stay ? ["#56B4E9", "#56B4E9"] : [shade.fill, shade.stroke];
    if (body.centre) return { outline: make("circle", shade, group), edges: [] };
    // A tube is as wide as it is in the cell from all sides.
    if (body.axis) return { outline: make("polyline", { ...line, "vector-effect": "none", stroke, "stroke-opacity": 0.3,
      "stroke-width": 2 * body.radius }, group), edges: [] };
    return {
      outline: make("polygon", { ...shade, fill, stroke: body.edges.length ? "none" : stroke }, group),
      edges: body.edges.map(() => make("polyline", { ...line, stroke, "stroke-width": 1 }, group)),
    };
  }),
  base: make("polygon", { ...line, fill: "var(--line)", "fill-opacity": 0.7, stroke: "var(--soft)", "stroke-width": 1.5 }, layers),
  belts: belts.map(() =>
    make("polyline", { ...line, class: "belt", stroke: "#E69F00", "stroke-width": 7, "stroke-opacity": 0.55 }, layers)),
  straight: make("polyline", { ...line, stroke: "var(--soft)", "stroke-width": 1.2, "stroke-dasharray": "1 4" }, layers),
  ahead: make("polyline", { ...line, id: "path", stroke: "var(--glass)", "stroke-width": 2 }, layers),
  done: make("polyline", { ...line, stroke: "var(--ink)", "stroke-width": 3 }, layers),
  chains: plan.motor_colours.map((colour, k) => {
    const group = make("g", { stroke: colour }, layers);
    return {
      group,
      bars: ["a", "b"].map((side) => make("line", { ...line, id: `bar${k + 1}${side}`, "stroke-width": 2 }, group)),
      elbow: make("line", { ...line, "stroke-width": 5 }, group),
      arm: make("line", { ...line, id: `arm${k + 1}`, "stroke-width": 6 }, group),
      name: make("text", { fill: "var(--ink)", stroke: "none", "text-anchor": "middle" }, group, String(k + 1)),
    };
  }),
  platform: make("polygon", { ...line, fill: "var(--soft)", "fill-opacity": 0.75, stroke: "var(--ink)", "stroke-width": 1.5 }, layers),
  tool: make("line", { ...line, stroke: "var(--ink)", "stroke-width": 3 }, layers),
  via: via.map((_, i) => {
    const group = make("g", { class: "via" }, layers);
    make("title", {}, group, `via point ${i + 1}`);
    return {
      sphere: make("circle", { ...line, stroke: "var(--soft)", "stroke-width": 1.2 }, group),
      point: make("polygon", { ...line, fill: "var(--paper)", stroke: "var(--ink)", "stroke-width": 1.5 }, group),
    };
  }),
  start: make("circle", { ...line, fill: "var(--paper)", stroke: "var(--ink)", "stroke-width": 1.5 }, layers),
  goal: make("circle", { ...line, fill: "var(--ink)", stroke: "var(--ink)", "stroke-width": 1.5 }, layers),
  point: make("circle", { ...line, id: "tool", fill: "#F0E442", stroke: "var(--ink)", "stroke-width": 1.5 }, layers),
};
make("title", {}, parts.start, "start");
make("title", {}, parts.goal, "goal");

function place(element, from, to) {
  const [[x1, y1], [x2, y2]] = [project(from), project(to)];
  for (const [key, value] of Object.entries({ x1, y1, x2, y2 })) element.setAttribute(key, value.toFixed(3));
}
function mark(element, point, radius) {
  const [cx, cy] = project(point);
  for (const [key, value] of Object.entries({ cx, cy, r: radius })) element.setAttribute(key, value.toFixed(3));
}
// The corners of the convex hull of points of the picture, in their order.
function hullOf(points) {
  const sorted = [...points].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  const half = (from) => {
    const chain = [];
    for (const p of from) {
      for (let n = chain.length; n > 1; n = chain.length) {
        const [a, b] = [chain[n - 2], chain[n - 1]];
        if ((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) > 0) break;
        chain.pop();
      }
      chain.push(p);
    }
    return chain.slice(0, -1);
  };
  return [...half(sorted), ...half([...sorted].reverse())];
}
const written = (points) => points.map((point) => point.slice(0, 2).map((value) => value.toFixed(2)).join(",")).join(" ");
function drawBodies() {
  bodies.forEach((body, i) => {
    const drawn = parts.bodies[i];
    if (body.centre) mark(drawn.outline, body.centre, body.radius);
    else if (body.axis) drawn.outline.setAttribute("points", along(body.corners));
    else drawn.outline.setAttribute("points", written(hullOf(body.corners.map(project))));
    drawn.edges.forEach((edge, k) => edge.setAttribute("points", along(body.edges[k])));
  });
}
function drawVia(size) {
  via.forEach(({ at: centre, within }, i) => {
    const [x, y] = project(centre), d = 0.014 * size;
    mark(parts.via[i].sphere, centre, within);
    parts.via[i].point.setAttribute("points", written([[x - d, y], [x, y - d], [x + d, y], [x, y + d]]));
  });
}
const joints = (chains, side) => chains.flatMap((chain) => chain.bars.map((bar) => bar[side]));

function inView(points) {
  const seen = points.map(project);
  const [left, top, right, bottom] = [Math.min, Math.max].flatMap((most) =>
    [0, 1].map((i) => most(...seen.map((point) => point[i]))));
  return [(left + right) / 2, (top + bottom) / 2, 0.56 * Math.max(right - left, bottom - top)];
}

function drawRobot() {
  const { point, centre, chains } = poses[now];
  const [x, y, size] = closeUp ? [...project(close.middle).slice(0, 2), 1.15 * close.radius] : inView(cell);
  const seen = size / zoom, left = x + size * aside[0] - seen, top = y + size * aside[1] - seen;
  scene.setAttribute("viewBox", [left, top, 2 * seen, 2 * seen].map((value) => value.toFixed(2)).join(" "));
  parts.base.setAttribute("points", along([0, 1, 2].flatMap((k) =>
    [-1, 1].map((side) => outward(k, 0, robot.base_radius, side * robot.half_width)))));
  parts.platform.setAttribute("points", along(joints(chains, 1)));
  drawBodies();
  drawVia(seen);
  belts.forEach((way, i) => parts.belts[i].setAttribute("points", along(way)));
  parts.straight.setAttribute("points", along(ends));
  parts.ahead.setAttribute("points", along(path));
  parts.done.setAttribute("points", along(path.slice(0, now + 1)));
  chains.forEach((chain, k) => {
    const drawn = parts.chains[k];
    drawn.bars.forEach((bar, side) => place(bar, ...chain.bars[side]));
    place(drawn.elbow, chain.bars[0][0], chain.bars[1][0]);
    place(drawn.arm, chain.shaft, chain.elbow);
    const [tx, ty] = project(outward(k, 0, 0.65 * robot.base_radius, 0));
    drawn.name.setAttribute("x", tx.toFixed(2));
    drawn.name.setAttribute("y", (ty + 0.02 * seen).toFixed(2));
    drawn.name.setAttribute("font-size", (0.07 * seen).toFixed(2));
    drawn.group.setAttribute("opacity", closeUp ? 0.25 : 1);
  });
  parts.platform.setAttribute("opacity", closeUp ? 0.25 : 1);
  const far = parts.chains.map((drawn, k) => [project(chains[k].elbow)[2], drawn.group]);
  far.sort((a, b) => b[0] - a[0]).forEach(([, group]) => layers.insertBefore(group, parts.platform));
  place(parts.tool, centre, point);
  mark(parts.start, ends[0], 0.012 * seen);
  mark(parts.goal, ends[1], 0.012 * seen);
  mark(parts.point, point, 0.016 * seen);
}

function fit() {
  [zoom, aside] = [1, [0, 0]];
  drawRobot();
}
function setView(name) {
  if (name) [turn, tilt] = VIEWS[name];
  for (const button of document.querySelectorAll("[data-view]")) {
    button.setAttribute("aria-pressed", String(button.dataset.view === name));
  }
  drawRobot();
}

for (const button of document.querySelectorAll("[data-view]")) {
  button.addEventListener("click", () => {
    setView(button.dataset.view);
    fit();
  });
}
byId("zoom").addEventListener("click", (event) => {
  closeUp = !closeUp;
  event.currentTarget.setAttribute("aria-pressed", String(closeUp));
  fit();
});
let from = null;
scene.addEventListener("pointerdown", (event) => {
  from = [event.clientX, event.clientY, turn, tilt];
  scene.setPointerCapture(event.pointerId);
});
scene.addEventListener("pointermove", (event) => {
  if (!from || !event.buttons) return;
  turn = from[2] + (event.clientX - from[0]) / 150;
  tilt = within(from[3] + (event.clientY - from[1]) / 150, -Math.PI / 2, Math.PI / 2);
  setView(null);
});
scene.addEventListener("wheel", (event) => {
  const closer = within(zoom * Math.exp(-event.deltaY / 400), 1, 20);
  if (closer === zoom) return; // the page scrolls on
  event.preventDefault();
  const { left, top, width, height } = scene.getBoundingClientRect();
  const pointer = [event.clientX - left - width / 2, event.clientY - top - height / 2];
  const most = 1 - 1 / closer, moved = (2 / Math.min(width, height)) * (1 / zoom - 1 / closer);
  aside = aside.map((value, i) => within(value + moved * pointer[i], -most, most));
  zoom = closer;
  drawRobot();
}, { passive: false });
