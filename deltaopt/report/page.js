"use strict";
(() => {
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
    ...(body.centre ? { centre: scaled(body.centre, MM), radius: MM * body.radius } : {
      corners: body.corners.map((corner) => scaled(corner, MM)),
      edges: body.edges.map((edge) => edge.map((point) => scaled(point, MM))),
    }),
  }));
  const via = plan.via.map(({ at, within }) => ({ at: scaled(at, MM), within: MM * within }));
  const VIEWS = { oblique: [0.6, 0.35], front: [0, 0], side: [Math.PI / 2, 0], top: [0, Math.PI / 2] };
  let [turn, tilt] = VIEWS.oblique, closeUp = false, now = 0;

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

  function project(point) {
    const [x, y, z] = minus(point, whole.middle);
    const across = Math.cos(turn) * y + Math.sin(turn) * z, away = Math.sin(turn) * y - Math.cos(turn) * z;
    const down = Math.cos(tilt) * x - Math.sin(tilt) * away;
    return [across + whole.middle[1], down + whole.middle[0], Math.cos(tilt) * away + Math.sin(tilt) * x];
  }
  const at = (point) => project(point).slice(0, 2).map((value) => value.toFixed(3)).join(",");
  const along = (points) => points.map(at).join(" ");

  const line = { fill: "none", "vector-effect": "non-scaling-stroke", "stroke-linecap": "round", "stroke-linejoin": "round" };
  const shade = { ...line, fill: "#8c8c8c", "fill-opacity": 0.3, stroke: "#595959", "stroke-width": 1 };
  const layers = make("g", {}, scene);
  const parts = {
    bodies: bodies.map((body, i) => {
      const group = make("g", { class: "body", id: `body${i + 1}` }, layers);
      make("title", {}, group, body.name);
      if (body.centre) return { outline: make("circle", shade, group), edges: [] };
      return {
        outline: make("polygon", { ...shade, stroke: body.edges.length ? "none" : shade.stroke }, group),
        edges: body.edges.map(() => make("polyline", { ...line, stroke: "#737373", "stroke-width": 1 }, group)),
      };
    }),
    base: make("polygon", { ...line, fill: "#d9d9d9", "fill-opacity": 0.7, stroke: "#595959", "stroke-width": 1.5 }, layers),
    straight: make("polyline", { ...line, stroke: "#767676", "stroke-width": 1.2, "stroke-dasharray": "1 4" }, layers),
    ahead: make("polyline", { ...line, id: "path", stroke: "#9a9a9a", "stroke-width": 2 }, layers),
    done: make("polyline", { ...line, stroke: "#000", "stroke-width": 3 }, layers),
    chains: plan.motor_colours.map((colour, k) => {
      const group = make("g", { stroke: colour }, layers);
      return {
        group,
        bars: ["a", "b"].map((side) => make("line", { ...line, id: `bar${k + 1}${side}`, "stroke-width": 2 }, group)),
        elbow: make("line", { ...line, "stroke-width": 5 }, group),
        arm: make("line", { ...line, id: `arm${k + 1}`, "stroke-width": 6 }, group),
        name: make("text", { fill: "#1a1a1a", stroke: "none", "text-anchor": "middle" }, group, String(k + 1)),
      };
    }),
    platform: make("polygon", { ...line, fill: "#595959", "fill-opacity": 0.75, stroke: "#1a1a1a", "stroke-width": 1.5 }, layers),
    tool: make("line", { ...line, stroke: "#1a1a1a", "stroke-width": 3 }, layers),
    via: via.map((_, i) => {
      const group = make("g", { class: "via" }, layers);
      make("title", {}, group, `via point ${i + 1}`);
      return {
        sphere: make("circle", { ...line, stroke: "#595959", "stroke-width": 1.2 }, group),
        point: make("polygon", { ...line, fill: "#fff", stroke: "#000", "stroke-width": 1.5 }, group),
      };
    }),
    start: make("circle", { ...line, fill: "#fff", stroke: "#000", "stroke-width": 1.5 }, layers),
    goal: make("circle", { ...line, fill: "#000", stroke: "#000", "stroke-width": 1.5 }, layers),
    point: make("circle", { ...line, id: "tool", fill: "#F0E442", stroke: "#000", "stroke-width": 1.5 }, layers),
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
    const [x, y, size] = closeUp ? [...project(close.middle).slice(0, 2), 1.15 * close.radius] : inView(corners);
    scene.setAttribute("viewBox", [x - size, y - size, 2 * size, 2 * size].map((value) => value.toFixed(2)).join(" "));
    parts.base.setAttribute("points", along([0, 1, 2].flatMap((k) =>
      [-1, 1].map((side) => outward(k, 0, robot.base_radius, side * robot.half_width)))));
    parts.platform.setAttribute("points", along(joints(chains, 1)));
    drawBodies();
    drawVia(size);
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
      drawn.name.setAttribute("y", (ty + 0.02 * size).toFixed(2));
      drawn.name.setAttribute("font-size", (0.07 * size).toFixed(2));
      drawn.group.setAttribute("opacity", closeUp ? 0.25 : 1);
    });
    parts.platform.setAttribute("opacity", closeUp ? 0.25 : 1);
    const far = parts.chains.map((drawn, k) => [project(chains[k].elbow)[2], drawn.group]);
    far.sort((a, b) => b[0] - a[0]).forEach(([, group]) => layers.insertBefore(group, parts.platform));
    place(parts.tool, centre, point);
    mark(parts.start, ends[0], 0.012 * size);
    mark(parts.goal, ends[1], 0.012 * size);
    mark(parts.point, point, 0.016 * size);
  }

  function setView(name) {
    if (name) [turn, tilt] = VIEWS[name];
    for (const button of document.querySelectorAll("[data-view]")) {
      button.setAttribute("aria-pressed", String(button.dataset.view === name));
    }
    drawRobot();
  }

  // Curves and bands over time.

  const limits = [...new Set(curves.of.map((curve) => curve.limit))];
  const subjects = [...new Set(curves.of.map((curve) => curve.subject))];
  const numberOf = (subject) => Number((subject.match(/ (\d)$/) || [0, 0])[1]);
  const styleOf = (subject) => {
    const k = numberOf(subject);
    if (!k) return { stroke: "#000" };
    return { stroke: plan.motor_colours[k - 1] ?? "#737373", "stroke-dasharray": DASHES[(k - 1) % DASHES.length] };
  };
  const colourOf = (limit) => plan.limit_colours[limits.indexOf(limit) % plan.limit_colours.length];
  const LEFT = 62, RIGHT = 12, TOP = 8, BOTTOM = 20;
  const cursors = [];

  function figure(parent, title) {
    const holder = document.createElement("figure");
    holder.className = "chart";
    const drawn = make("svg", { role: "img", "aria-label": title });
    const caption = document.createElement("figcaption");
    holder.append(caption, drawn);
    byId(parent).append(holder);
    const seek = (event) => {
      const box = drawn.getBoundingClientRect();
      const share = (event.clientX - box.left - LEFT) / (box.width - LEFT - RIGHT);
      stop();
      show(Math.round(last * Math.min(1, Math.max(0, share))));
    };
    drawn.addEventListener("pointerdown", (event) => { drawn.setPointerCapture(event.pointerId); seek(event); });
    drawn.addEventListener("pointermove", (event) => { if (event.buttons) seek(event); });
    return { drawn, caption };
  }
  function axis(drawn, width, height) {
    drawn.replaceChildren();
    drawn.setAttribute("viewBox", `0 0 ${width} ${height}`);
    drawn.style.height = `${height}px`;
    const x = (t) => LEFT + (width - LEFT - RIGHT) * t / duration;
    const ticks = width < 420 ? 2 : 5;
    for (let i = 0; i <= ticks; i++) {
      const t = duration * i / ticks, place = { x: x(t), y: height - 5, "text-anchor": i === ticks ? "end" : "middle" };
      make("line", { x1: x(t), x2: x(t), y1: TOP, y2: height - BOTTOM, stroke: "#d9d9d9" }, drawn);
      make("text", place, drawn, `${(MM * t).toPrecision(3)}${i === ticks ? " ms" : ""}`);
    }
    return x;
  }
  function cursor(drawn, x, height) {
    const upright = make("line", { class: "cursor", y1: TOP, y2: height - BOTTOM, stroke: "#000", "stroke-width": 1.5 }, drawn);
    return () => {
      const place = x(frames.t[now]).toFixed(2);
      upright.setAttribute("x1", place);
      upright.setAttribute("x2", place);
    };
  }
  function sampleAt(t) {
    let low = 0, high = curves.t.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (curves.t[middle] <= t + 1e-9) low = middle; else high = middle - 1;
    }
    return low;
  }

  const charts = limits.map((limit) => {
    const own = curves.of.filter((curve) => curve.limit === limit);
    const { drawn, caption } = figure("curves", `${limit} as a share of its bound over time`);
    const title = document.createElement("strong");
    title.textContent = limit;
    caption.append(title);
    const values = own.map((curve) => {
      const item = document.createElement("span"), key = make("svg", { viewBox: "0 0 30 8", "aria-hidden": "true" });
      make("line", { x1: 0, x2: 30, y1: 4, y2: 4, "stroke-width": 2.5, ...styleOf(curve.subject) }, key);
      const value = document.createElement("span");
      item.append(key, `${curve.subject} `, value);
      caption.append(item);
      return value;
    });
    const least = own.some((curve) => curve.values.some((value) => value < 0)) ? -1 : 0;
    const most = own.some((curve) => curve.values.some((value) => value > 0)) || !least ? 1 : 0;
    let move = () => {};
    return {
      draw() {
        const width = Math.max(240, drawn.clientWidth), height = 150, x = axis(drawn, width, height);
        const y = (value) => TOP + (height - TOP - BOTTOM) * (1.08 * most - value) / (1.08 * (most - least));
        for (const value of [...new Set([least, 0, most])]) {
          const bound = value !== 0;
          make("line", { x1: LEFT, x2: width - RIGHT, y1: y(value), y2: y(value), stroke: bound ? "#1a1a1a" : "#d9d9d9",
            "stroke-dasharray": bound ? "2 3" : "" }, drawn);
          make("text", { x: LEFT - 6, y: y(value) + 4, "text-anchor": "end" }, drawn, `${100 * value} %`.replace("-", "−"));
        }
        for (const curve of own) {
          const points = curve.values.map((value, i) => `${x(curves.t[i]).toFixed(1)},${y(value).toFixed(1)}`);
          make("polyline", { points: points.join(" "), fill: "none", "stroke-width": 1.8, ...styleOf(curve.subject) }, drawn);
        }
        move = cursor(drawn, x, height);
      },
      move() {
        move();
        const i = sampleAt(frames.t[now]);
        own.forEach((curve, k) => { values[k].textContent = `${Math.round(100 * curve.values[i])} %`.replace("-", "−"); });
      },
    };
  });
  cursors.push(...charts);

  // A row for every limit that a subject is at, since it may be at two at once; one for other motors.
  const rows = subjects.flatMap((subject) => {
    const own = active.filter((each) => each.subject === subject);
    const none = subject.startsWith("motor ") ? [{ subject, spans: [] }] : [];
    return (own.length ? own : none).map((each, k) => ({ ...each, first: k === 0 }));
  });
  if (rows.length) {
    const { drawn, caption } = figure("bands", "Which limit holds when, for each motor");
    const note = document.createElement("span");
    note.textContent = "Upper half of a row: at the upper bound; lower half: at the lower bound.";
    for (const limit of limits.filter((name) => active.some((each) => each.limit === name))) {
      const item = document.createElement("span"), key = make("svg", { viewBox: "0 0 30 8", "aria-hidden": "true" });
      make("rect", { width: 30, height: 8, fill: colourOf(limit), stroke: "#595959" }, key);
      item.append(key, limit);
      caption.append(item);
    }
    caption.append(note);
    let move = () => {};
    cursors.push({
      draw() {
        const row = 30, width = Math.max(240, drawn.clientWidth), height = TOP + BOTTOM + row * rows.length;
        const x = axis(drawn, width, height);
        rows.forEach(({ subject, limit, spans, first }, k) => {
          const top = TOP + row * k, middle = top + row / 2;
          if (first) make("text", { x: LEFT - 6, y: middle + 4, "text-anchor": "end" }, drawn, subject);
          for (const [begin, end, upper] of spans) {
            const span = make("rect", { class: "span", x: x(begin).toFixed(2), y: upper ? top + 3 : middle,
              width: Math.max(1, x(end) - x(begin)).toFixed(2), height: row / 2 - 3, fill: colourOf(limit) }, drawn);
            const times = `${(MM * begin).toPrecision(4)} to ${(MM * end).toPrecision(4)} ms`;
            make("title", {}, span, `${limit} of ${subject} at its ${upper ? "upper" : "lower"} bound, ${times}`);
          }
          make("line", { x1: LEFT, x2: width - RIGHT, y1: middle, y2: middle, stroke: "#595959", "stroke-width": 0.7 }, drawn);
        });
        move = cursor(drawn, x, height);
      },
      move() { move(); },
    });
  }

  // Time.

  let running = 0;
  function show(frame) {
    now = Math.min(last, Math.max(0, frame));
    const text = `${(MM * frames.t[now]).toFixed(1)} ms`;
    slider.value = now;
    slider.setAttribute("aria-valuetext", text);
    byId("now").textContent = `${text} of ${(MM * duration).toFixed(1)}`;
    drawRobot();
    for (const each of cursors) each.move();
  }
  function stop() {
    cancelAnimationFrame(running);
    running = 0;
    play.textContent = "▶";
    play.setAttribute("aria-label", "Play");
  }
  function start() {
    const begin = now === last ? 0 : frames.t[now];
    let first = null;
    play.textContent = "❚❚";
    play.setAttribute("aria-label", "Pause");
    const step = (time) => {
      first ??= time;
      const t = begin + Number(byId("pace").value) * (time - first) / MM;
      show(Math.round(last * t / duration));
      if (now === last) stop(); else running = requestAnimationFrame(step);
    };
    running = requestAnimationFrame(step);
  }

  slider.max = last;
  slider.addEventListener("input", () => { stop(); show(Number(slider.value)); });
  play.addEventListener("click", () => (running ? stop() : start()));
  document.addEventListener("keydown", (event) => {
    if (event.altKey || event.ctrlKey || event.metaKey || event.target === slider || event.target.tagName === "SELECT") return;
    if (event.key === " " && event.target.tagName !== "BUTTON") (running ? stop : start)();
    else if (event.key === "ArrowLeft" || event.key === "ArrowRight") {
      stop();
      show(now + (event.key === "ArrowLeft" ? -1 : 1));
    }
    else return;
    event.preventDefault();
  });
  slider.addEventListener("keydown", (event) => {
    if (event.key === " ") { (running ? stop : start)(); event.preventDefault(); }
  });
  for (const button of document.querySelectorAll("[data-view]")) {
    button.addEventListener("click", () => setView(button.dataset.view));
  }
  byId("zoom").addEventListener("click", (event) => {
    closeUp = !closeUp;
    event.currentTarget.setAttribute("aria-pressed", String(closeUp));
    drawRobot();
  });
  let from = null;
  scene.addEventListener("pointerdown", (event) => {
    from = [event.clientX, event.clientY, turn, tilt];
    scene.setPointerCapture(event.pointerId);
  });
  scene.addEventListener("pointermove", (event) => {
    if (!from || !event.buttons) return;
    turn = from[2] + (event.clientX - from[0]) / 150;
    tilt = Math.min(Math.PI / 2, Math.max(-Math.PI / 2, from[3] + (event.clientY - from[1]) / 150));
    setView(null);
  });
  const redraw = () => { for (const each of cursors) { each.draw(); each.move(); } };
  new ResizeObserver(redraw).observe(byId("curves"));
  setView("oblique");
  redraw();
  show(0);
})();
