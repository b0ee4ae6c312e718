// Four charts with all that is compared: a ring of the last seconds, thinned to what a screen can show.

import uPlot from "../vendor/uplot.min.js";
import { AXES, DEG, flight, value } from "./state.js";

const WINDOW_S = 20, POINTS = 320, MARK_S = 4;
const MARKS = "●■▲◆★✚▼○□△◇☆✖▽◀▶◁▷◉◈";  // as many as there are surfaces at most; colours come again
export const COLOURS = ["#6ec1f0", "#f0a830", "#dd92c0", "#2fbf94", "#f0e442", "#ff7a4d", "#b0bec8", "#ffffff"];

// A chart: curves, each with the value it shows now; solid is what is, dashed is what was asked or estimated.
function plans(surfaces) {
  const rad = (name) => () => { const x = value(name); return x === null ? null : x * DEG; };
  const share = (axis) => () => {
    const residual = value(`${axis}_residual_rad_s`), threshold = value(`${axis}_threshold_rad_s`);
    return residual === null || !threshold ? null : residual / threshold;
  };
  const pairs = (names, solid, dashed) => names.flatMap((name, i) => [
    { label: name, colour: i, now: solid(name, i) }, { label: `${name} dashed`, colour: i, dash: true, now: dashed(name, i) },
  ]);
  return [
    { title: "Residual / threshold", unit: "1", names: AXES, range: [-1.6, 1.6], limits: [-1, 1],
      curves: AXES.map((axis, i) => ({ label: axis, colour: i, now: share(axis) })) },
    { title: "Rates, deg/s (dashed: reference)", names: AXES, floor: 4,
      curves: pairs(AXES, (a) => rad(`${a}_measured_rad_s`), (a) => rad(`${a}_reference_rad_s`)) },
    { title: "Surfaces, deg (dashed: command)", names: surfaces, floor: 3,
      curves: pairs(surfaces, (s) => rad(`${s}_effective_rad`), (s) => rad(`${s}_cmd_rad`)) },
    { title: "Effectiveness (dashed: estimate)", names: surfaces, range: [-0.05, 1.15],
      curves: pairs(surfaces, (_, i) => () => flight.frame?.effectiveness?.[i] ?? null, (s) => () => value(`${s}_effectiveness_estimate`)) },
  ];
}

// Where to mark curves: the newest point, and the first after each multiple of MARK_S.
function marked(times) {
  const places = [];
  for (let j = 1; j < times.length; j += 1) if (Math.floor(times[j] / MARK_S) > Math.floor(times[j - 1] / MARK_S)) places.push(j);
  return times.length ? [...places, times.length - 1] : places;
}

// Of many surfaces: what tells one from those of its kind, and the kind, as in "L in" and "elevator".
const SHORT = { left: "L", right: "R", inboard: "in", outboard: "out" };
function shortened(name) {
  const words = name.split("_"), kind = words.pop();
  return [words.map((word) => SHORT[word] ?? word).join(" "), kind];
}

class Chart {
  constructor(parent, plan) {
    this.plan = plan;
    this.box = document.createElement("div");
    this.box.className = "chart";
    this.box.append(this.title(), this.place = Object.assign(document.createElement("div"), { className: "plot" }));
    parent.append(this.box);
    this.data = [[], ...plan.curves.map(() => [])];
    this.plot = new uPlot(this.options(), this.data, this.place);
    const canvas = this.place.querySelector("canvas");
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `chart: ${plan.title}`);
    this.watch = new ResizeObserver(() => this.fit());
    this.watch.observe(this.place);
  }

  title() {
    const title = document.createElement("h2"), keys = Object.assign(document.createElement("span"), { className: "keys" });
    title.append(Object.assign(document.createElement("b"), { textContent: this.plan.title }), keys);
    let kind = "";
    this.plan.names.forEach((name, i) => {
      const [said, of] = this.plan.names.length > COLOURS.length ? shortened(name) : [name, ""];
      if (of !== kind) keys.append(Object.assign(document.createElement("span"), { className: "key", textContent: of }));
      kind = of;
      const key = Object.assign(document.createElement("span"), { className: "key", textContent: `${MARKS[i]} ${said}`, title: name });
      key.style.color = COLOURS[i % COLOURS.length];
      keys.append(key);
    });
    return title;
  }

  options() {
    const { plan } = this, axis = { stroke: "#a9bac8", grid: { stroke: "#2a3d4e", width: 1 }, ticks: { show: false }, font: "11px sans-serif" };
    return {
      width: 300, height: 100, legend: { show: false }, cursor: { show: false }, padding: [4, 8, 0, 0], pxAlign: false,
      scales: { x: { time: false, range: () => this.span ?? [0, WINDOW_S] }, y: { range: (_, low, high) => this.range(low, high) } },
      axes: [{ ...axis, size: 20, space: 60 }, { ...axis, size: 38, space: 22 }],
      series: [{}, ...plan.curves.map(({ label, colour, dash }) => ({
        label, stroke: COLOURS[colour % COLOURS.length], width: dash ? 1 : 1.5, dash: dash ? [5, 4] : undefined, points: { show: false }, spanGaps: false,
      }))],
      hooks: { draw: [(plot) => this.drawLimits(plot), (plot) => this.drawMarks(plot), (plot) => this.drawClipped(plot), (plot) => this.drawInstants(plot)] },
    };
  }

  range(low, high) {
    if (this.plan.range) return this.plan.range;
    const floor = this.plan.floor, reach = Math.max(floor, Math.abs(low ?? 0), Math.abs(high ?? 0));
    const steps = Math.ceil(reach / floor) * floor * 1.05;
    return [-steps, steps];
  }

  drawLimits(plot) {
    const { ctx, bbox } = plot;
    if (!this.plan.limits) return;
    ctx.save();
    ctx.strokeStyle = "#ff7a4d";
    ctx.lineWidth = 2;
    for (const limit of this.plan.limits) {
      const y = plot.valToPos(limit, "y", true);
      ctx.beginPath();
      ctx.moveTo(bbox.left, y);
      ctx.lineTo(bbox.left + bbox.width, y);
      ctx.stroke();
    }
    ctx.restore();
  }

  // The mark of its key on each solid curve, at fixed times of flight: curves are told apart without colour.
  drawMarks(plot) {
    const { ctx, bbox } = plot, [times] = this.data, places = marked(times);
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width + 6, bbox.height);
    ctx.clip();
    ctx.font = `${10 * devicePixelRatio}px sans-serif`;
    ctx.textAlign = "center";
    ctx.textBaseline = "middle";
    this.plan.curves.forEach(({ colour, dash }, i) => {
      if (dash) return;
      ctx.fillStyle = COLOURS[colour % COLOURS.length];
      for (const j of places) {
        const y = this.data[i + 1][j];
        if (y !== null && y !== undefined) ctx.fillText(MARKS[colour], plot.valToPos(times[j], "x", true), plot.valToPos(y, "y", true));
      }
    });
    ctx.restore();
  }

  // Beyond a fixed range: an arrow at the edge with the largest value.
  drawClipped(plot) {
    if (!this.plan.range) return;
    const { ctx, bbox } = plot, [low, high] = this.plan.range, [times] = this.data;
    ctx.save();
    ctx.font = `bold ${10 * devicePixelRatio}px sans-serif`;
    ctx.textAlign = "center";
    this.plan.curves.forEach(({ colour, dash }, i) => {
      if (dash) return;
      const values = this.data[i + 1];
      const peak = values.reduce((most, v, j) => (v !== null && (v > high || v < low) && (most < 0 || Math.abs(v) > Math.abs(values[most])) ? j : most), -1);
      if (peak < 0) return;
      const up = values[peak] > high;
      ctx.fillStyle = COLOURS[colour % COLOURS.length];
      ctx.textBaseline = up ? "top" : "bottom";
      const x = Math.min(Math.max(plot.valToPos(times[peak], "x", true), bbox.left + 20), bbox.left + bbox.width - 20);
      ctx.fillText(`${up ? "▲" : "▼"}${values[peak].toFixed(1)}`, x, up ? bbox.top + 1 : bbox.top + bbox.height - 1);
    });
    ctx.restore();
  }

  // Vertical lines at fault, alarm and name; letters of lines that are close together share one flag.
  drawInstants(plot) {
    const { ctx, bbox } = plot;
    const unit = devicePixelRatio;
    const flags = [];
    ctx.save();
    ctx.setLineDash([3 * unit, 3 * unit]);
    ctx.strokeStyle = "#e8eef3";
    for (const { t, letter } of flight.instants ?? []) {
      const x = plot.valToPos(t, "x", true);
      if (x < bbox.left || x > bbox.left + bbox.width) continue;
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
      const close = flags.find((flag) => Math.abs(flag.x - x) < 14 * unit);
      if (close) close.letters += ` ${letter}`;
      else flags.push({ x, letters: letter });
    }
    ctx.font = `bold ${11 * unit}px sans-serif`;
    ctx.textBaseline = "bottom";
    ctx.textAlign = "left";
    for (const { x, letters } of flags) {
      const width = ctx.measureText(letters).width + 6 * unit;
      const left = Math.min(x, bbox.left + bbox.width - width);
      const bottom = bbox.top + bbox.height;
      ctx.fillStyle = "#e8eef3";
      ctx.fillRect(left, bottom - 14 * unit, width, 14 * unit);
      ctx.fillStyle = "#16202a";
      ctx.fillText(letters, left + 3 * unit, bottom - unit);
    }
    ctx.restore();
  }

  fit() {
    const { clientWidth: width, clientHeight: height } = this.place;
    if (width > 40 && height > 30) this.plot.setSize({ width, height });
  }

  push(t) {
    this.data[0].push(t);
    this.plan.curves.forEach((curve, i) => this.data[i + 1].push(curve.now()));
    let old = 0;
    while (this.data[0][old] < t - WINDOW_S) old += 1;
    if (old) for (const column of this.data) column.splice(0, old);
  }

  draw(t) {
    this.span = t < WINDOW_S ? [0, WINDOW_S] : [t - WINDOW_S, t];
    this.plot.setData(this.data);
  }

  end() {
    this.watch.disconnect();
    this.plot.destroy();
    this.box.remove();
  }
}

export class Charts {
  constructor(parent) {
    this.parent = parent;
    this.charts = [];
    this.turn = 0;
  }

  meet(hello) {
    for (const chart of this.charts) chart.end();
    this.charts = plans(hello.surfaces).map((plan) => new Chart(this.parent, plan));
    this.newest = -Infinity;
  }

  take() {
    const t = value("t_s");
    if (t - this.newest < WINDOW_S / POINTS) return;
    this.newest = t;
    for (const chart of this.charts) chart.push(t);
    this.stale = true;
  }

  // One chart a frame, in turn: each is drawn 15 times a second, and no frame pays for all of them.
  draw() {
    if (!this.charts.length || this.newest === -Infinity) return;
    this.turn = (this.turn + 1) % this.charts.length;
    this.charts[this.turn].draw(this.newest);
  }
}
