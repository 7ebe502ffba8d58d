// Charts and bands over time, and time itself.

const limits = [...new Set(curves.of.map((curve) => curve.limit))];
const subjects = [...new Set(curves.of.map((curve) => curve.subject))];
const styleOf = (colours, k) => {
  if (k < 0) return { stroke: "var(--ink)" };
  return { stroke: colours[k] ?? "var(--soft)", "stroke-dasharray": DASHES[k % DASHES.length] };
};
const numberOf = (subject) => Number((subject.match(/ (\d)$/) || [0, 0])[1]);
const colourOf = (limit) => plan.limit_colours[limits.indexOf(limit) % plan.limit_colours.length];
const LEFT = 62, RIGHT = 12, TOP = 8, BOTTOM = 20;
const cursors = [];

function add(parent, name, text = "", className = "") {
  const element = document.createElement(name);
  element.className = className;
  element.textContent = text;
  parent.append(element);
  return element;
}
// Under a pointer: an upright hair, and beside it what the chart tells of that instant.
const hair = add(document.body, "div", "", "hair"), tip = add(document.body, "div", "", "tip");
function showTip(event, box, told) {
  hair.hidden = tip.hidden = !told;
  if (!told) return;
  tip.replaceChildren();
  for (const text of told) add(tip, "div", text);
  Object.assign(hair.style, { left: `${event.clientX}px`, top: `${box.top + TOP}px`, height: `${box.height - TOP - BOTTOM}px` });
  const isRight = event.clientX + tip.offsetWidth + 24 > document.documentElement.clientWidth;
  Object.assign(tip.style, { left: `${event.clientX + (isRight ? -tip.offsetWidth - 12 : 12)}px`, top: `${box.top + TOP}px` });
}
showTip(null, null, null);

// A chart, of which tell says something for an instant; its caption is for a title and a key.
function figure(parent, title, tell) {
  const holder = add(byId(parent), "figure", "", "chart"), caption = add(holder, "figcaption");
  const drawn = make("svg", { role: "img", "aria-label": title }, holder);
  const look = (event) => {
    const box = drawn.getBoundingClientRect();
    const share = within((event.clientX - box.left - LEFT) / (box.width - LEFT - RIGHT), 0, 1);
    if (event.buttons) {
      stop();
      show(Math.round(last * share));
    }
    showTip(event, box, event.pointerType === "touch" ? null : [inMs(duration * share), ...tell(duration * share)]);
  };
  drawn.addEventListener("pointerdown", (event) => { drawn.setPointerCapture(event.pointerId); look(event); });
  drawn.addEventListener("pointermove", look);
  drawn.addEventListener("pointerleave", () => showTip(null, null, null));
  return { drawn, caption };
}
const inMs = (t) => `${(MM * t).toFixed(1)} ms`;
function entry(caption, drawn, text) {
  const item = add(caption, "span");
  item.append(make("svg", { viewBox: "0 0 30 8", "aria-hidden": "true" }), `${text} `);
  item.firstChild.append(drawn);
  return add(item, "span");
}

// Round numbers, about so many, between two.
function ticks(low, high, about) {
  const rough = (high - low) / about, power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find((factor) => factor * power >= rough);
  const first = Math.ceil(low / step - 1e-9), count = Math.floor(high / step + 1e-9) - first + 1;
  return Array.from({ length: count }, (_, i) => Number(((first + i) * step).toPrecision(9)));
}
// A chart's frame: an axis of time below, and the cursor, an upright line, in front of what is added.
function axis(drawn, width, height) {
  drawn.replaceChildren();
  drawn.setAttribute("viewBox", `0 0 ${width} ${height}`);
  drawn.style.height = `${height}px`;
  const x = (t) => LEFT + (width - LEFT - RIGHT) * t / duration;
  const round = ticks(0, MM * duration, width < 420 ? 4 : 8);
  round.forEach((value, i) => {
    const across = x(value / MM), isLast = i === round.length - 1;
    make("line", { x1: across, x2: across, y1: TOP, y2: height - BOTTOM, stroke: "var(--line)" }, drawn);
    const anchor = isLast && across > width - RIGHT - 20 ? "end" : "middle";
    make("text", { x: anchor === "end" ? width - 1 : across, y: height - 5, "text-anchor": anchor }, drawn, `${value}${isLast ? " ms" : ""}`);
  });
  return x;
}
function cursor(drawn, x, height) {
  const upright = make("line", { class: "cursor", y1: TOP, y2: height - BOTTOM, stroke: "var(--ink)", "stroke-width": 1.5 }, drawn);
  return () => {
    const place = x(frames.t[now]).toFixed(2);
    upright.setAttribute("x1", place);
    upright.setAttribute("x2", place);
  };
}
const sampleAt = (t) => curves.t.findLastIndex((each) => each <= t + 1e-9);

// Curves that share an axis from least to most; bounds are dotted. Values are told by told.
function chart({ title, note = "", own, styles, least, most, marks, bounds, told }) {
  const tellOf = (curve, t) => {
    const value = curve.values[sampleAt(t)];
    return value === null ? "–" : told(value);
  };
  const { drawn, caption } = figure("curves", `${title} over time`, (t) =>
    own.map((curve) => `${curve.subject} ${tellOf(curve, t)}`));
  add(caption, "strong", title);
  if (note) add(caption, "span", note);
  const values = own.map((curve, k) =>
    entry(caption, make("line", { x1: 0, x2: 30, y1: 4, y2: 4, "stroke-width": 2.5, ...styles[k] }), curve.subject));
  let move = () => {};
  cursors.push({
    draw() {
      const width = Math.max(240, drawn.clientWidth), height = 150, x = axis(drawn, width, height);
      const box = { x: LEFT, y: TOP, width: width - LEFT - RIGHT, height: height - TOP - BOTTOM };
      const y = (value) => TOP + box.height * (most - value) / (most - least);
      for (const value of marks) {
        make("line", { x1: LEFT, x2: width - RIGHT, y1: y(value), y2: y(value), stroke: "var(--line)" }, drawn);
        make("text", { x: LEFT - 6, y: y(value) + 4, "text-anchor": "end" }, drawn, told(value, 0));
      }
      for (const value of bounds) {
        make("line", { x1: LEFT, x2: width - RIGHT, y1: y(value), y2: y(value), stroke: "var(--ink)", "stroke-dasharray": "2 3" }, drawn);
      }
      const inner = make("svg", { ...box, viewBox: Object.values(box).join(" ") }, drawn); // cuts off what is beyond
      own.forEach((curve, k) => {
        const path = curve.values.map((value, i, all) => (value === null ? "" :
          `${(all[i - 1] ?? null) === null ? "M" : "L"}${x(curves.t[i]).toFixed(1)},${y(value).toFixed(1)}`));
        make("path", { d: path.join(""), fill: "none", "stroke-width": 1.8, ...styles[k] }, inner);
      });
      move = cursor(drawn, x, height);
    },
    move() {
      move();
      own.forEach((curve, k) => { values[k].textContent = tellOf(curve, frames.t[now]); });
    },
  });
}

const percent = (value) => `${Math.round(100 * value)} %`.replace("-", "−");
for (const limit of limits.filter((name) => name !== "clearance")) {
  const own = curves.of.filter((curve) => curve.limit === limit);
  const least = own.some((curve) => curve.values.some((value) => value < 0)) ? -1 : 0;
  const most = own.some((curve) => curve.values.some((value) => value > 0)) || !least ? 1 : 0;
  chart({
    title: limit, own, least: 1.04 * least, most: 1.04 * most, told: percent,
    styles: own.map((curve) => styleOf(plan.motor_colours, numberOf(curve.subject) - 1)),
    marks: [...new Set([least, 0, most])], bounds: [least, most].filter((bound) => bound !== 0),
  });
}
// Clearance in mm: as far up as the nearest body is at any time.
const { of: near, asked } = plan.clearance;
if (near.length) {
  const inMm = (value, digits = Math.abs(value) < 10 ? 2 : 0) => `${value.toFixed(digits)} mm`.replace("-", "−");
  const nearest = curves.t.map((_, i) =>
    Math.min(...near.map((curve) => curve.values[i] ?? Infinity))).filter(isFinite);
  const binding = near.reduce((a, b) => (b.least < a.least ? b : a));
  const least = Math.min(0, binding.least), most = 1.1 * Math.max(1, ...asked, ...nearest);
  chart({
    title: "clearance", own: near, least, most, told: inMm, bounds: asked, marks: ticks(least, most, 4),
    note: `nearest: ${binding.subject}, ${inMm(binding.least, 1)}; ${asked.join(", ")} mm are asked for`,
    styles: near.map((_, k) => styleOf(plan.body_colours, k)),
  });
}

// A row for every limit that a subject is at, since it may be at two at once; one for other motors.
const rows = subjects.flatMap((subject) => {
  const own = active.filter((each) => each.subject === subject);
  const none = subject.startsWith("motor ") ? [{ subject, spans: [] }] : [];
  return (own.length ? own : none).map((each, k) => ({ ...each, first: k === 0 }));
});
if (rows.length) {
  const { drawn, caption } = figure("bands", "Which limit holds when, for each motor", (t) =>
    rows.flatMap(({ subject, limit, spans }) => spans.filter(([begin, end]) => begin <= t && t <= end).map(([, , upper]) =>
      `${subject}: ${limit} at its ${upper ? "upper" : "lower"} bound`)));
  for (const limit of limits.filter((name) => active.some((each) => each.limit === name))) {
    entry(caption, make("rect", { width: 30, height: 8, fill: colourOf(limit), stroke: "var(--soft)" }), limit);
  }
  add(caption, "span", "Upper half of a row: at the upper bound; lower half: at the lower bound.");
  let move = () => {};
  cursors.push({
    draw() {
      const row = 30, width = Math.max(240, drawn.clientWidth), height = TOP + BOTTOM + row * rows.length;
      const x = axis(drawn, width, height);
      rows.forEach(({ subject, limit, spans, first }, k) => {
        const top = TOP + row * k, middle = top + row / 2;
        if (first) make("text", { x: LEFT - 6, y: middle + 4, "text-anchor": "end" }, drawn, subject);
        for (const [begin, end, upper] of spans) {
        make("rect", { class: "span", x: x(begin).toFixed(2), y: upper ? top + 3 : middle,
            width: Math.max(1, x(end) - x(begin)).toFixed(2), height: row / 2 - 3, fill: colourOf(limit) }, drawn);
        }
        make("line", { x1: LEFT, x2: width - RIGHT, y1: middle, y2: middle, stroke: "var(--soft)", "stroke-width": 0.7 }, drawn);
      });
      move = cursor(drawn, x, height);
    },
    move() { move(); },
  });
}

// Time.

let running = 0;
function show(frame) {
  now = within(frame, 0, last);
  const text = inMs(frames.t[now]);
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
const redraw = () => { for (const each of cursors) { each.draw(); each.move(); } };
new ResizeObserver(redraw).observe(byId("curves"));
setView("oblique");
redraw();
show(0);
