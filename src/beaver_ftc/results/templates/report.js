"use strict";
// The curves, the replay and the flight path of a report. All share one clock and one window of time.

const DATA = JSON.parse(document.getElementById("data").textContent);
const byId = (id) => document.getElementById(id);
const make = (tag, attributes, ...children) => {
  const element = Object.assign(document.createElement(tag), attributes);
  element.append(...children);
  return element;
};

// ---- numbers -------------------------------------------------------------------------------------------------

const floats = (text, type) => new type(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);

for (const run of DATA.runs) {
  run.levels = run.levels.map((level) =>
    Object.fromEntries(Object.entries(level).map(([name, text]) => [name, floats(text, name === "t_s" ? Float64Array : Float32Array)])));
}

/** Index of the last time not after t (0 where all are). */
function indexAt(times, t) {
  let low = 0, high = times.length;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= t) low = middle; else high = middle;
  }
  return low;
}

/** The finest series of a run that covers the window. */
function seriesFor(run, start, end) {
  const covers = (level) => level.t_s[0] <= start && level.t_s[level.t_s.length - 1] >= end;
  return run.levels.findLast(covers) ?? run.levels[0];
}

function niceStep(span, count) {
  const raw = span / count, magnitude = 10 ** Math.floor(Math.log10(raw));
  return magnitude * [1, 2, 5, 10].find((m) => m * magnitude >= raw * 0.999);
}

function ticks(low, high, count) {
  const step = niceStep(high - low, count), found = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + step * 1e-9; i++) found.push(i * step);
  return { values: found, digits: Math.min(6, Math.max(0, -Math.floor(Math.log10(step) + 1e-9))) };
}

const DECIMALS = { deg: 2, "deg/s": 3, "deg/s²": 2, m: 1, "m/s": 2, inHg: 2, "": 3 };

/** A value with the fixed decimals of its unit, so that a legend does not jump; large ones with an exponent. */
function shown(value, unit) {
  if (Number.isNaN(value)) return "–";
  if (Math.abs(value) >= 1e6) return value.toExponential(2);
  return value.toFixed(DECIMALS[unit] ?? 3).replace(/^-(0\.?0*)$/, "$1") + (unit ? ` ${unit}` : "");
}

// ---- the shared clock and window -------------------------------------------------------------------------------

const lastTime = (run) => run.levels[0].t_s.at(-1) ?? 0;
const END = Math.max(...DATA.runs.map(lastTime), 0.01);
const clock = { now: 0, start: 0, end: END, speed: 1, playing: false };
const painters = [];
let painting = false;

function repaint() {
  if (painting) return;
  painting = true;
  requestAnimationFrame(() => {
    painting = false;
    byId("clock").value = `${clock.now.toFixed(2)} s`;
    byId("time").value = clock.now;
    painters.forEach((painter) => painter());
  });
}

function showWindow(start, end) {
  clock.start = Math.max(0, start);
  clock.end = Math.min(END, Math.max(end, clock.start + 0.02));
  repaint();
}

/** Widen or narrow the window by a factor; the time under the cursor stays where it is, if it can be seen. */
function zoom(factor) {
  const seen = clock.now >= clock.start && clock.now <= clock.end;
  const about = seen ? clock.now : (clock.start + clock.end) / 2;
  showWindow(about - (about - clock.start) * factor, about + (clock.end - about) * factor);
}

function setTime(t) {
  clock.now = Math.min(END, Math.max(0, t));
  if (clock.playing && (clock.now < clock.start || clock.now > clock.end)) {
    const width = clock.end - clock.start;
    clock.start = Math.min(clock.now, END - width);
    clock.end = clock.start + width;
  }
  repaint();
}

let replayed = 0;
function replay(instant) {
  if (!clock.playing) return;
  setTime(clock.now + ((instant - replayed) / 1000) * clock.speed);
  replayed = instant;
  if (clock.now >= END) play(false); else requestAnimationFrame(replay);
}

function play(on) {
  clock.playing = on;
  byId("play").textContent = on ? "❚❚ pause" : "▶ replay";
  if (!on) return;
  if (clock.now >= END) clock.now = 0;
  replayed = performance.now();
  requestAnimationFrame(replay);
}

// ---- a canvas that knows its size and draws only while it can be seen ----------------------------------------------

const PAPER = 700;  // width of a printed page in pixels: what is wider is drawn again for it, not squeezed

const seen = new IntersectionObserver((entries) => {
  for (const entry of entries) entry.target.inView = entry.isIntersecting;
  repaint();
}, { rootMargin: "200px" });
const sized = new ResizeObserver(repaint);

function paintable(canvas, draw) {
  const paint = (onPaper) => {
    if (!onPaper && !canvas.inView) return;
    const ratio = Math.max(window.devicePixelRatio || 1, onPaper ? 2 : 1);
    const shrink = onPaper ? Math.min(1, PAPER / document.querySelector("main").clientWidth) : 1;
    const width = canvas.clientWidth * shrink, height = canvas.clientHeight;
    if (!width || !height) return;
    if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
    if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    draw(pen, width, height);
  };
  painters.push(() => paint(false));
  seen.observe(canvas);
  sized.observe(canvas);
  window.addEventListener("beforeprint", () => paint(true));
}

// ---- panels ----------------------------------------------------------------------------------------------------

const MARGIN = { left: 52, right: 10, top: 20, bottom: 26 };
const STEPS_LEFT = 86; // room for the longest name of a mode
const BAND = 6;
const LOWEST = 0.1; // of a logarithmic axis: what is smaller is noise
const CLIPPED = 0.005; // share of the values at either end that does not set a clipped axis
const MODE_COLOURS = DATA.modes.map(([, colour]) => colour);

class Panel {
  constructor(spec, runs, run) {
    Object.assign(this, { spec, runs, run });
    this.canvas = make("canvas", { role: "img", ariaLabel: `${spec.label} against time` });
    this.readouts = spec.traces.map(() => make("output"));
    this.left = spec.steps.length ? STEPS_LEFT : MARGIN.left;
    this.element = make("figure", { className: spec.steps.length ? "panel steps" : "panel" }, this.caption(), this.canvas);
    if (spec.bars) this.canvas.style.height = `${MARGIN.top + MARGIN.bottom + 22 * spec.steps.length}px`;
    paintable(this.canvas, (pen, width, height) => this.draw(pen, width, height));
    this.listen();
  }

  caption() {
    const unit = this.spec.unit ? ` (${this.spec.unit})` : "";
    const caption = make("figcaption", {}, make("strong", { textContent: this.spec.label + unit }));
    this.spec.traces.forEach((trace, i) => {
      if (!trace.label || this.spec.bars) return;
      if (trace.role === "unlike" && this.run.levels[0][trace.column].every(Number.isNaN)) return;
      const entry = make("span");
      if (this.spec.traces.length > 1) {
        entry.innerHTML = sample(DATA.looks[trace.role]);
        entry.append(` ${trace.label} `);
      }
      entry.append(this.readouts[i]);
      caption.append(entry);
    });
    if (this.spec.shade_column) {
      const box = make("i", { className: "box" });
      box.style.background = this.spec.shade_colour;
      this.shadeKey = caption.appendChild(make("span", { hidden: true }, box, ` ${this.spec.shade_label}`));
    }
    return caption;
  }

  listen() {
    const canvas = this.canvas, time = (event) => this.timeAt(event.offsetX);
    canvas.addEventListener("pointerdown", (event) => {
      this.from = time(event);
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      this.to = this.from === undefined ? undefined : time(event);
      if (!clock.playing) setTime(time(event));
    });
    canvas.addEventListener("pointerup", (event) => {
      const ends = [this.from, time(event)].sort((a, b) => a - b);
      this.from = this.to = undefined;
      if (ends[1] - ends[0] > 0.02 * (clock.end - clock.start)) showWindow(...ends);
      else setTime(ends[1]);
    });
    canvas.addEventListener("pointercancel", () => { this.from = this.to = undefined; repaint(); });
    canvas.addEventListener("dblclick", () => showWindow(0, END));
  }

  timeAt(x) {
    const width = this.canvas.clientWidth - this.left - MARGIN.right;
    const share = Math.min(1, Math.max(0, (x - this.left) / width));
    return clock.start + share * (clock.end - clock.start);
  }

  /** Lowest and highest value in the window over all runs, so that runs side by side share their scale. */
  range() {
    const { steps, limits, log_scale: log, line_at: level } = this.spec;
    if (steps.length) return [-0.4, steps.length - 0.6];
    if (limits) return limits;
    let low = level ?? Infinity, high = level ?? -Infinity;
    const all = [];
    for (const run of this.runs) {
      const series = seriesFor(run, clock.start, clock.end);
      const first = indexAt(series.t_s, clock.start), last = indexAt(series.t_s, clock.end);
      for (const trace of this.spec.traces) {
        const values = series[trace.column];
        for (let i = first; i <= last; i++) {
          const value = values[i] * trace.factor + trace.offset;
          if (value < low) low = value;
          if (value > high) high = value;
          if (this.spec.clips_spikes && !Number.isNaN(value)) all.push(value);
        }
      }
    }
    this.ends = [low, high];
    if (all.length) {
      all.sort((one, other) => one - other);
      const [from, to] = [CLIPPED, 1 - CLIPPED].map((share) => all[Math.round(share * (all.length - 1))]);
      const pad = 0.1 * (to - from) || 0.1 * Math.abs(to) || 1;
      return [Math.max(low - 0.3 * pad, from - pad), Math.min(high + 0.3 * pad, to + pad)];
    }
    if (low > high) return log ? [LOWEST, 10] : [-1, 1];
    if (log) return [Math.max(low, LOWEST) / 1.5, Math.max(high, LOWEST) * 1.5];
    const pad = 0.07 * (high - low) || 0.1 * Math.abs(high) || 1;
    return [low - pad, high + pad];
  }

  draw(pen, width, height) {
    const [low, high] = this.range(), log = this.spec.log_scale;
    const left = this.left, right = width - MARGIN.right, top = MARGIN.top, bottom = height - MARGIN.bottom;
    const scale = log ? Math.log10 : Number;
    const x = (t) => left + ((t - clock.start) / (clock.end - clock.start)) * (right - left);
    const y = (v) => bottom - ((scale(v) - scale(low)) / (scale(high) - scale(low))) * (bottom - top);
    const frame = { pen, x, y, left, right, top, bottom, low, high };
    const series = seriesFor(this.run, clock.start, clock.end);
    pen.font = "11px system-ui, sans-serif";
    this.drawAxes(frame);
    pen.save();
    pen.beginPath();
    pen.rect(left, top, right - left, bottom - top);
    pen.clip();
    this.drawShade(frame, series);
    if (this.spec.bars) this.drawBars(frame, series);
    else for (const trace of this.inOrder()) this.drawTrace(frame, series, trace);
    pen.restore();
    if (this.spec.clips_spikes) this.drawSpikes(frame);
    this.drawModes(frame, series);
    this.drawMarks(frame);
    this.drawCursor(frame, series);
  }

  inOrder() {
    return [...this.spec.traces].sort((a, b) => DATA.looks[a.role].z_order - DATA.looks[b.role].z_order);
  }

  drawAxes({ pen, x, y, left, right, top, bottom, low, high }) {
    const { steps, log_scale: log, line_at: level } = this.spec;
    const time = ticks(clock.start, clock.end, Math.max(2, (right - left) / 75));
    pen.strokeStyle = "#e3e3e3";
    pen.fillStyle = "#444";
    pen.lineWidth = 1;
    pen.textAlign = "center";
    pen.textBaseline = "top";
    for (const t of time.values) {
      line(pen, x(t), top, x(t), bottom);
      pen.fillText(t.toFixed(time.digits) + (t === time.values[0] ? " s" : ""), x(t), bottom + BAND + 5);
    }
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    for (const [value, label] of valueTicks(low, high, log, this.spec.bars ? [...steps].reverse() : steps, (bottom - top) / 28)) {
      line(pen, left, y(value), right, y(value));
      pen.fillText(label, left - 6, y(value));
    }
    pen.strokeStyle = "#777";
    if (level !== null) line(pen, left, y(level), right, y(level));
    pen.strokeRect(left, top, right - left, bottom - top);
  }

  drawTrace({ pen, x, y, low }, series, trace) {
    const look = DATA.looks[trace.role], times = series.t_s, values = series[trace.column];
    const first = Math.max(0, indexAt(times, clock.start) - 1), last = Math.min(times.length - 1, indexAt(times, clock.end) + 1);
    const stepped = this.spec.steps.length > 0;
    let drawn = false, before = 0;
    pen.strokeStyle = look.colour;
    pen.lineWidth = look.width;
    pen.setLineDash(look.dash);
    pen.beginPath();
    for (let i = first; i <= last; i++) {
      let value = values[i] * trace.factor + trace.offset;
      if (Number.isNaN(value)) { drawn = false; continue; }
      if (this.spec.log_scale && value < low) value = low;
      const px = x(times[i]), py = y(value);
      if (!drawn) pen.moveTo(px, py);
      else if (stepped) { pen.lineTo(px, before); pen.lineTo(px, py); } else pen.lineTo(px, py);
      drawn = true;
      before = py;
    }
    pen.stroke();
    pen.setLineDash([]);
  }

  /** A row a label: a bar while one of its traces is 0, a thin line while all that are there are 1. */
  drawBars({ pen, x, y }, series) {
    this.spec.steps.forEach((label, place) => {
      const of = this.spec.traces.filter((trace) => trace.label === label), at = (i, value) => series[this.spec.bars_during_column][i] === 1 && of.some((trace) => series[trace.column][i] === value);
      const bar = (inside, half, colour) => {
        pen.fillStyle = colour;
        for (const [start, end] of stretches(series.t_s, inside)) pen.fillRect(x(start), y(this.row(place) + half), Math.max(1, x(end) - x(start)), y(this.row(place) - half) - y(this.row(place) + half));
      };
      bar((i) => at(i, 0), 0.36, DATA.looks[of[0].role].colour);
      bar((i) => at(i, 1) && !at(i, 0), 0.04, "#8a8a8a");
    });
  }

  /** Rows of bars are read from the top. */
  row(place) {
    return this.spec.bars ? this.spec.steps.length - 1 - place : place;
  }

  /** Beyond a clipped axis: an arrow at its edge, with the largest value. */
  drawSpikes({ pen, right, top, bottom, low, high }) {
    const [least, most] = this.ends;
    pen.fillStyle = "#555";
    pen.textAlign = "right";
    for (const [beyond, arrow, value, baseline, at] of [[most > high, "▲", most, "top", top + 2], [least < low, "▼", least, "bottom", bottom - 2]]) {
      if (!beyond) continue;
      pen.textBaseline = baseline;
      pen.fillText(`${arrow} ${shown(value, this.spec.unit)}`, right - 4, at);
    }
  }

  drawShade({ pen, x, top, bottom }, series) {
    const flags = series[this.spec.shade_column];
    if (!flags) return;
    let any = false;
    pen.fillStyle = this.spec.shade_colour;
    for (const [start, end] of stretches(series.t_s, (i) => flags[i] === 1)) {
      pen.fillRect(x(start), top, Math.max(1, x(end) - x(start)), bottom - top);
      any = true;
    }
    this.shadeKey.hidden = !any;
  }

  drawModes({ pen, x, left, right, bottom }, series) {
    pen.save();
    pen.beginPath();
    pen.rect(left, bottom + 1, right - left, BAND);
    pen.clip();
    MODE_COLOURS.forEach((colour, mode) => {
      pen.fillStyle = colour;
      for (const [start, end] of stretches(series.t_s, (i) => series.mode[i] === mode)) pen.fillRect(x(start), bottom + 1, x(end) - x(start), BAND);
    });
    pen.restore();
  }

  drawMarks({ pen, x, left, right, top, bottom }) {
    let free = -Infinity; // where the next badge can stand: above the panel, beside the one before
    for (const mark of this.run.marks) {
      const at = x(mark.time_s);
      if (at < left - 0.5 || at > right + 0.5) continue;
      const badge = Math.max(at, free);
      free = badge + 13;
      pen.strokeStyle = pen.fillStyle = mark.colour;
      pen.lineWidth = 1;
      line(pen, badge, top - 4, at, top);
      pen.setLineDash(mark.dash);
      line(pen, at, top, at, bottom);
      pen.setLineDash([]);
      pen.fillRect(badge - 5.5, top - 16, 11, 12);
      pen.fillStyle = "#fff";
      pen.textAlign = "center";
      pen.textBaseline = "middle";
      pen.font = "bold 9px system-ui, sans-serif";
      pen.fillText(mark.letter, badge, top - 9.5);
    }
  }

  drawCursor({ pen, x, left, right, top, bottom }, series) {
    const at = x(clock.now), i = indexAt(series.t_s, clock.now);
    this.spec.traces.forEach((trace, k) => { this.readouts[k].value = this.inWords(series[trace.column][i] * trace.factor + trace.offset); });
    if (at >= left && at <= right) {
      pen.strokeStyle = "#000";
      pen.lineWidth = 0.8;
      line(pen, at, top, at, bottom + BAND);
    }
    if (this.to !== undefined) {
      pen.fillStyle = "rgba(0, 114, 178, .15)";
      pen.fillRect(x(this.from), top, x(this.to) - x(this.from), bottom - top);
    }
  }

  inWords(value) {
    const { steps, unit } = this.spec;
    return steps.length ? steps[Math.round(value)] ?? "–" : shown(value, unit);
  }
}

function line(pen, x0, y0, x1, y1) {
  pen.beginPath();
  pen.moveTo(x0, y0);
  pen.lineTo(x1, y1);
  pen.stroke();
}

/** Values and labels along the value axis. */
function valueTicks(low, high, log, steps, count) {
  if (steps.length) return steps.map((name, i) => [i, name]);
  if (log) {
    const decades = [];
    for (let d = Math.ceil(Math.log10(low) - 1e-9); d <= Math.log10(high) + 1e-9; d++) decades.push([10 ** d, String(+(10 ** d).toPrecision(1))]);
    return decades;
  }
  let wanted = Math.max(2, count), found = ticks(low, high, wanted);
  while (found.values.length < 2 && wanted < 40) found = ticks(low, high, wanted *= 2);
  return found.values.map((value) => [value, value.toFixed(found.digits)]);
}

/** [start, end] of each stretch of time in which `holds`. */
function stretches(times, holds) {
  const found = [];
  for (let i = 0, start = -1; i <= times.length; i++) {
    const on = i < times.length && holds(i);
    if (on && start < 0) start = i;
    if (!on && start >= 0) { found.push([times[start], times[Math.min(i, times.length - 1)]]); start = -1; }
  }
  return found;
}

function sample(look) {
  const dash = look.dash.length ? ` stroke-dasharray="${look.dash.join(" ")}"` : "";
  return `<svg viewBox="0 0 28 8" aria-hidden="true"><line x1="0" y1="4" x2="28" y2="4" stroke="${look.colour}" stroke-width="${look.width + 0.6}"${dash}/></svg>`;
}

// ---- the flight path in space ------------------------------------------------------------------------------------

const sub = (a, b) => a.map((value, i) => value - b[i]);
const dot = (a, b) => a.reduce((sum, value, i) => sum + value * b[i], 0);

/** The Beaver as polygons, metres in body axes (x forward, y right, z down). */
const AIRFRAME = [
  { fill: "#c9852f", points: [[4.6, 0, -0.2], [3.6, 0, -1.1], [1.6, 0, -1.3], [-5, 0, -0.4], [-5, 0, 0.1], [2.5, 0, 1], [4.4, 0, 0.7]] },
  { fill: "#c9852f", points: [[4.6, 0, 0.2], [3.4, 0.7, 0], [0, 0.7, 0], [-5, 0.1, -0.2], [-5, -0.1, -0.2], [0, -0.7, 0], [3.4, -0.7, 0]] },
  { fill: "#b04a17", points: [[-3.7, 0, -0.5], [-4.9, 0, -2.3], [-5.6, 0, -2.3], [-5.2, 0, 0]] },
  { fill: "#f2d7a8", points: [[-4, 2.4, -0.5], [-4, -2.4, -0.5], [-5.2, -2.4, -0.5], [-5.2, 2.4, -0.5]] },
  { fill: "#f7e3bd", points: [[2, 7.32, -1.4], [2, -7.32, -1.4], [0.4, -7.32, -1.4], [0.4, 7.32, -1.4]] },
];

/** A low-wing twin jet, for aircraft with spoilers or a stabiliser that moves. part: what damage may take, with what is on it. */
const mirrored = (points) => points.map(([x, y, z]) => [x, -y, z]);
const sides = (fill, part, points, on) => [["right", points], ["left", mirrored(points)]].map(([side, of]) => ({ fill, part: `${side}-${part}`, on: `${side}-${on}`, points: of }));
const JET = [
  { fill: "#d7dbe0", points: [[6.2, 0, 0], [5.2, 0, -0.7], [-4, 0, -0.7], [-6.4, 0, -0.4], [-6.4, 0, -0.1], [-3, 0, 0.6], [5, 0, 0.6]] },
  { fill: "#e6e9ec", points: [[6.2, 0, 0], [5, 0.65, 0], [-3, 0.65, 0], [-6.4, 0.1, -0.2], [-6.4, -0.1, -0.2], [-3, -0.65, 0], [5, -0.65, 0]] },
  { fill: "#4f6b8a", part: "fin", points: [[-3.9, 0, -0.7], [-5.6, 0, -2.8], [-6, 0, -2.8], [-5.5, 0, -0.5]] },
  { fill: "#2d4661", part: "rudder", on: "fin", points: [[-5.5, 0, -0.6], [-6, 0, -2.8], [-6.4, 0, -2.8], [-5.95, 0, -0.6]] },
  ...sides("#aebccb", "stabiliser", [[-4.7, 0.2, -0.3], [-5.8, 2.1, -0.4], [-6.1, 2.1, -0.4], [-5.6, 0.2, -0.3]]),
  ...sides("#5f7893", "elevator", [[-5.6, 0.3, -0.3], [-6.1, 2.1, -0.4], [-6.4, 2.1, -0.4], [-6, 0.3, -0.3]], "stabiliser"),
  ...sides("#c3ced9", "wing", [[1.7, 0.6, 0.35], [-0.9, 3.9, 0.2], [-1.9, 3.9, 0.2], [-1.1, 0.6, 0.35]]),
  ...sides("#c3ced9", "wing-tip", [[-0.9, 3.9, 0.2], [-2, 5.4, 0.1], [-2.7, 5.4, 0.1], [-1.9, 3.9, 0.2]]),
  ...sides("#5f7893", "outboard-flap", [[-1.35, 2, 0.3], [-1.9, 3.8, 0.2], [-2.3, 3.8, 0.2], [-1.8, 2, 0.3]]),
  ...sides("#3c4b5a", "engine", [[1.6, 1.6, 0.9], [1.6, 2.2, 0.9], [0, 2.2, 0.8], [0, 1.6, 0.8]]),
];

/** Body to north-east-up, from bank, pitch and heading. */
function attitude(phi, theta, psi) {
  const [sf, cf, st, ct, sp, cp] = [Math.sin(phi), Math.cos(phi), Math.sin(theta), Math.cos(theta), Math.sin(psi), Math.cos(psi)];
  return ([x, y, z]) => [
    ct * cp * x + (sf * st * cp - cf * sp) * y + (cf * st * cp + sf * sp) * z,
    ct * sp * x + (sf * st * sp + cf * cp) * y + (cf * st * sp - sf * cp) * z,
    st * x - sf * ct * y - cf * ct * z,
  ];
}

class Space {
  constructor(run) {
    this.run = run;
    this.follow = false;
    this.elevation = 0.35;
    this.zoom = 1;
    this.canvas = make("canvas", { role: "img", ariaLabel: "flight path and attitude" });
    this.text = make("output");
    const toggle = make("button", { type: "button", textContent: "fly along" });
    toggle.onclick = () => {
      this.follow = !this.follow;
      toggle.textContent = this.follow ? "show the whole path" : "fly along";
      repaint();
    };
    this.element = make("figure", { className: "space" }, this.canvas, make("figcaption", {}, toggle, " ", this.text));
    this.measure();
    paintable(this.canvas, (pen, width, height) => this.draw(pen, width, height));
    this.listen();
  }

  /** Middle and size of the flight, and the ground it is drawn over. */
  measure() {
    const { north_m: n, east_m: e, altitude_m: h } = this.run.levels[0];
    const ends = [n, e, h].map((values) => values.reduce(([low, high], v) => [Math.min(low, v), Math.max(high, v)], [Infinity, -Infinity]));
    this.centre = ends.map(([low, high]) => (low + high) / 2);
    this.extent = Math.max(60, ...ends.map(([low, high]) => high - low));
    this.floor = ends[2][0] - 0.06 * this.extent;
    // Seen from abeam: from behind, the ground rises towards the horizon, and a descent looks like a climb.
    this.azimuth = Math.atan2(e[e.length - 1] - e[0], n[n.length - 1] - n[0]) + Math.PI / 2;
    this.stretch = Math.min(8, Math.max(1, (0.25 * this.extent) / Math.max(1, ends[2][1] - ends[2][0])));
  }

  listen() {
    const canvas = this.canvas;
    canvas.addEventListener("pointerdown", (event) => { this.held = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); });
    canvas.addEventListener("pointermove", (event) => {
      if (!this.held) return;
      this.azimuth += (event.clientX - this.held[0]) * 0.008;
      this.elevation = Math.min(1.5, Math.max(-0.2, this.elevation + (event.clientY - this.held[1]) * 0.006));
      this.held = [event.clientX, event.clientY];
      repaint();
    });
    canvas.addEventListener("pointerup", () => { this.held = undefined; });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom = Math.min(8, Math.max(0.2, this.zoom * Math.exp(event.deltaY * 0.001)));
      repaint();
    }, { passive: false });
  }

  /** Where the aircraft is now, north-east-up in metres, and its attitude. */
  aircraft(series) {
    const i = indexAt(series.t_s, clock.now), j = Math.min(i + 1, series.t_s.length - 1);
    const share = j > i ? Math.min(1, Math.max(0, (clock.now - series.t_s[i]) / (series.t_s[j] - series.t_s[i]))) : 0;
    const at = (name) => series[name][i] + share * (series[name][j] - series[name][i]);
    return { position: this.raised([at("north_m"), at("east_m"), at("altitude_m")]), attitude: attitude(series.phi_rad[i], series.theta_rad[i], series.psi_rad[i]), index: i };
  }

  /** Heights drawn larger than they are when the whole path is shown: a level flight is otherwise a line. */
  raised([n, e, h]) {
    return [n, e, this.follow ? h : this.centre[2] + (h - this.centre[2]) * this.stretch];
  }

  camera(width, height, target, distance) {
    const [sa, ca, se, ce] = [Math.sin(this.azimuth), Math.cos(this.azimuth), Math.sin(this.elevation), Math.cos(this.elevation)];
    const forward = [-ce * ca, -ce * sa, -se], right = [sa, -ca, 0], up = [-se * ca, -se * sa, ce];
    const eye = target.map((value, i) => value - forward[i] * distance), focal = 1.1 * Math.min(width, 1.6 * height);
    return (point) => {
      const ray = sub(point, eye), depth = dot(ray, forward);
      return depth > 0.02 * distance ? [width / 2 + (focal * dot(ray, right)) / depth, height / 2 - (focal * dot(ray, up)) / depth, depth] : null;
    };
  }

  draw(pen, width, height) {
    const series = seriesFor(this.run, clock.now, clock.now), craft = this.aircraft(series);
    const size = this.follow ? 1 : this.extent / 160;
    const floor = this.raised([0, 0, this.floor])[2];
    const target = this.follow ? craft.position : [this.centre[0], this.centre[1], (this.centre[2] + floor) / 2];
    const distance = this.follow ? 45 : this.fitting(width, height, target, floor);
    const project = this.camera(width, height, target, distance * this.zoom);
    this.drawGround(pen, project, target, floor);
    this.drawPath(pen, project, floor);
    this.drawMarks(pen, project);
    this.drawAircraft(pen, project, craft, size);
    this.say(series, craft.index);
  }

  /** The distance from which the whole path, and the ground below it, is in sight. */
  fitting(width, height, target, floor) {
    const { t_s, north_m, east_m, altitude_m } = this.run.levels[0], skip = Math.max(1, Math.floor(t_s.length / 40));
    const points = [];
    for (let i = 0; i < t_s.length; i += skip) points.push(this.raised([north_m[i], east_m[i], altitude_m[i]]), [north_m[i], east_m[i], floor]);
    const inSight = (at) => at && at[0] > 30 && at[0] < width - 30 && at[1] > 62 && at[1] < height - 10;
    let distance = 0.4 * this.extent;
    while (distance < 20 * this.extent && !points.map(this.camera(width, height, target, distance)).every(inSight)) distance *= 1.1;
    return distance;
  }

  drawGround(pen, project, target, floor) {
    const reach = this.follow ? 400 : 0.75 * this.extent, step = niceStep(2 * reach, 10);
    const from = [0, 1].map((k) => Math.floor((target[k] - reach) / step) * step), count = Math.ceil((2 * reach) / step) + 1;
    this.gridStep = step;
    pen.strokeStyle = "rgba(60, 90, 70, .25)";
    pen.lineWidth = 1;
    for (let i = 0; i <= count; i++) {
      const near = i * step, far = count * step;
      polyline(pen, project, [[from[0] + near, from[1], floor], [from[0] + near, from[1] + far / 2, floor], [from[0] + near, from[1] + far, floor]]);
      polyline(pen, project, [[from[0], from[1] + near, floor], [from[0] + far / 2, from[1] + near, floor], [from[0] + far, from[1] + near, floor]]);
    }
  }

  drawPath(pen, project, floor) {
    const { t_s, north_m, east_m, altitude_m, mode } = this.run.levels[0];
    const skip = Math.max(1, Math.floor(t_s.length / 1500)), mast = Math.max(1, Math.floor(t_s.length / 30));
    const point = (i) => this.raised([north_m[i], east_m[i], altitude_m[i]]);
    pen.lineWidth = 1;
    pen.strokeStyle = "rgba(0, 0, 0, .18)";
    for (let i = 0; i < t_s.length; i += mast) polyline(pen, project, [point(i), [north_m[i], east_m[i], floor]]);
    polyline(pen, project, Array.from({ length: Math.ceil(t_s.length / skip) }, (_, k) => [north_m[k * skip], east_m[k * skip], floor]));
    pen.lineWidth = 3;
    for (let i = 0; i < t_s.length - 1; ) {
      const piece = [point(i)], now = mode[i];
      while (i < t_s.length - 1 && mode[i] === now) { i = Math.min(i + skip, t_s.length - 1); piece.push(point(i)); }
      pen.strokeStyle = ["#2a8f73", "#2b8cc4", "#c98500", "#a64f84"][now] ?? "#333";
      polyline(pen, project, piece);
    }
  }

  drawMarks(pen, project) {
    const { t_s, north_m, east_m, altitude_m } = this.run.levels[0];
    let rank = 0, before = -Infinity;
    this.run.marks.forEach((mark) => {
      const i = indexAt(t_s, mark.time_s), at = project(this.raised([north_m[i], east_m[i], altitude_m[i]]));
      if (!at) return;
      rank = Math.abs(at[0] - before) < 13 ? rank + 1 : 0;
      before = at[0];
      const up = at[1] - 26 - 14 * rank;
      pen.strokeStyle = pen.fillStyle = mark.colour;
      pen.lineWidth = 1;
      if (rank === 0) line(pen, at[0], at[1], at[0], up + 6);
      pen.fillRect(at[0] - 6, up - 6, 12, 13);
      pen.fillStyle = "#fff";
      pen.font = "bold 10px system-ui, sans-serif";
      pen.textAlign = "center";
      pen.textBaseline = "middle";
      pen.fillText(mark.letter, at[0], up + 1);
    });
  }

  drawAircraft(pen, project, { position, attitude: turned }, size) {
    const gone = this.run.damage.filter(({ at_s, end_s }) => clock.now >= at_s && clock.now < (end_s ?? Infinity)).map(({ part }) => part);
    const whole = this.run.jet ? JET.filter(({ part, on }) => !gone.includes(part) && !gone.includes(on)) : AIRFRAME;
    const placed = whole.map(({ fill, points }) => ({ fill, corners: points.map((p) => project(turned(p).map((v, k) => position[k] + v * size))) }));
    const depth = ({ corners }) => corners.reduce((sum, c) => sum + c[2], 0) / corners.length;
    const visible = placed.filter(({ corners }) => corners.every(Boolean)).sort((a, b) => depth(b) - depth(a));
    pen.strokeStyle = "#3b2a10";
    pen.lineWidth = 1;
    for (const { fill, corners } of visible) {
      pen.fillStyle = fill;
      pen.beginPath();
      corners.forEach(([px, py], k) => (k ? pen.lineTo(px, py) : pen.moveTo(px, py)));
      pen.closePath();
      pen.fill();
      pen.stroke();
    }
  }

  say(series, i) {
    const degrees = (name) => ((series[name][i] * 180) / Math.PI).toFixed(1);
    const taller = this.follow || this.stretch < 1.05 ? "" : `, heights ${this.stretch.toFixed(1)} times`;
    this.text.value = `altitude ${series.altitude_m[i].toFixed(1)} m, bank ${degrees("phi_rad")}°, pitch ${degrees("theta_rad")}°, ` +
      `heading ${degrees("psi_rad")}°; grid ${this.gridStep} m${taller}. Drag to look around, wheel to come closer.`;
  }
}

function polyline(pen, project, points) {
  let drawn = false;
  pen.beginPath();
  for (const point of points) {
    const at = project(point);
    if (!at) { drawn = false; continue; }
    if (drawn) pen.lineTo(at[0], at[1]); else pen.moveTo(at[0], at[1]);
    drawn = true;
  }
  pen.stroke();
}

// ---- the page --------------------------------------------------------------------------------------------------

function gridOf(view, run) {
  const grid = make("div", { className: "grid" });
  grid.style.setProperty("--across", DATA.runs.length > 1 ? 1 : view.n_panel_columns);
  grid.append(...view.panels.map((panel) => new Panel(panel, DATA.runs, run).element));
  return grid;
}

function absentIn(view, run) {
  const columns = view.panels.flatMap((panel) => panel.traces.map((trace) => trace.column));
  return view.text_without_data && columns.every((name) => run.levels[0][name].every(Number.isNaN));
}

function section(view) {
  const runs = make("div", { className: "runs" });
  for (const run of DATA.runs) {
    const title = DATA.runs.length > 1 ? [make("h3", { textContent: run.name })] : [];
    const body = absentIn(view, run) ? make("p", { className: "hint", textContent: view.text_without_data }) : gridOf(view, run);
    runs.append(make("div", {}, ...title, body));
  }
  const title = make("h2", { textContent: view.title });
  if (!view.folded) return make("section", { id: view.name }, title, runs);
  return make("section", { id: view.name }, make("details", { ontoggle: repaint }, make("summary", {}, title), runs));
}

for (const run of DATA.runs) run.marks.sort((one, other) => one.time_s - other.time_s); // badges are placed from left to right
byId("space").append(...DATA.runs.map((run) => new Space(run).element));
byId("views").append(...DATA.views.map(section));
byId("contents").append(...DATA.views.map((view) => make("a", { href: `#${view.name}`, textContent: view.title.split(":")[0] })));
document.querySelectorAll("main section:not([id]) > h2").forEach((title, i) => {
  title.id = `more-${i}`;
  byId("contents").append(make("a", { href: `#${title.id}`, textContent: title.textContent.split(":")[0] }));
});
byId("time").max = END;
byId("time").oninput = (event) => setTime(Number(event.target.value));
byId("play").onclick = () => play(!clock.playing);
byId("speed").onchange = (event) => { clock.speed = Number(event.target.value); };
byId("whole").onclick = () => showWindow(0, END);
byId("near").onclick = () => showWindow(Math.min(...DATA.runs.map((run) => run.window[0])), Math.max(...DATA.runs.map((run) => run.window[1])));
byId("near").hidden = !DATA.runs.some((run) => run.marks.length);
window.addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((part) => { part.open = true; }));
window.addEventListener("afterprint", repaint);
window.addEventListener("keydown", (event) => {
  if (event.target !== document.body) return;
  const step = (clock.end - clock.start) / 100;
  const keys = {
    ArrowRight: () => setTime(clock.now + step), ArrowLeft: () => setTime(clock.now - step), " ": () => play(!clock.playing),
    "+": () => zoom(0.5), "-": () => zoom(2), 0: () => showWindow(0, END),
  };
  if (keys[event.key]) { event.preventDefault(); keys[event.key](); }
});
window.beaverReport = { clock, showWindow, setTime, play };
repaint();
