// What the diagnosis says, the events, and the tabs.

import { DEG, flight, value } from "./state.js";

const byId = (id) => document.getElementById(id);

function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

export function drawDiagnosis() {
  const frame = flight.frame, hidden = flight.state?.game.phase === "waiting";
  const alarm = byId("alarm"), on = Boolean(frame.detected);
  alarm.classList.toggle("on", on);
  alarm.classList.toggle("hidden", hidden);
  const inconclusive = !on && !hidden && Boolean(frame.inconclusive);
  alarm.classList.toggle("inconclusive", inconclusive);
  const quiet = inconclusive ? `nothing can be concluded: ${frame.inconclusive}` : "no alarm";
  setText(alarm, hidden ? "hidden during the game" : on ? alarmText(frame) : quiet);
  setText(byId("verdict"), hidden ? "" : verdictText(frame));
  setText(byId("knows"), flight.state?.knows ?? "");
  setText(byId("mode"), hidden ? "hidden" : frame.mode ?? "");
  drawCandidates(frame, hidden);
}

const alarmText = ({ axis }) => `ALARM: ${axis ? `residual of ${axis} beyond its threshold` : "instruments disagree beyond their bound"}`;

function verdictText(frame) {
  if (!frame.detected) return "";
  if (!frame.isolated) return `${frame.candidates.length} candidates remain`;
  if (frame.isolated === frame.type) return `Named: ${frame.isolated}, none of the known faults`;
  const kinds = (frame.type ? [frame.type] : frame.candidates).map((kind) => kind.replaceAll("_", " "));
  const size = frame.estimate === null || frame.estimate === undefined ? "" : sizeText(flight.hello.sizes[frame.type], frame.estimate);
  return `Named: ${frame.isolated}${kinds.length ? `, ${kinds.join(" or ")}` : ""}${size}`;
}

const inDegrees = (rad) => `${(rad * DEG).toFixed(1)} deg`;

// What the diagnosis makes of it: theta of what is lost in %, else rad.
function sizeText(size, estimate) {
  if (!size) return "";
  const [word, unit] = size;
  return ` ${word} ${unit === "%" ? `${Math.round(-100 * estimate)} %` : inDegrees(estimate)}`;
}

const MANY = 12; // surfaces, of which only the candidates are shown once there is an alarm
const LISTED = 3; // fault types within a chip: more are counted

// The types that remain for each surface: [] where it has no types; a surface that is no candidate is missing.
function remaining(frame) {
  const left = new Map();
  const add = (place, kind) => left.set(place, [...(left.get(place) ?? []), ...(kind ? [kind.replaceAll("_", " ")] : [])]);
  if (frame.isolated) (frame.type ? [frame.type] : frame.candidates.length ? frame.candidates : [""]).forEach((kind) => add(frame.isolated, kind));
  else for (const candidate of frame.candidates ?? []) add(...candidate.split(":"));
  return left;
}

function chipText(label, kinds, out, named) {
  if (out) return `${label} out`;
  const types = !kinds?.length ? "" : kinds.length > LISTED ? `: ${kinds.length} types` : `: ${kinds.join(", ")}`;
  return label + (named ? " named" : "") + types;
}

function drawCandidates(frame, hidden) {
  const list = byId("candidates"), asked = !hidden && Boolean(frame.detected);
  const left = asked ? remaining(frame) : new Map();
  list.classList.toggle("many", list.children.length > MANY);
  list.classList.toggle("asked", hidden || asked);
  const first = list.children[0]; // another diagnosis than the flight began with has no such candidates
  list.classList.toggle("gone", Boolean(first) && !hidden && value(`fie_${first.dataset.column}_excluded`) === null);
  for (const item of list.children) {
    const { name, label } = item.dataset, out = asked && !left.has(name), named = asked && frame.isolated === name;
    item.classList.toggle("out", out);
    item.classList.toggle("named", named);
    setText(item, chipText(label, left.get(name), out, named));
  }
}

// A chip a surface: the one whose name is the longest that an estimator's begins with.
export function meetDiagnosis(hello) {
  const columns = hello.columns.filter((c) => c.startsWith("fie_") && c.endsWith("_excluded")).map((c) => c.slice(4, -9));
  const surfaceOf = (name) => hello.surfaces.filter((of) => `${name}_`.startsWith(`${of}_`)).sort((a, b) => b.length - a.length)[0] ?? name;
  const chips = new Map();
  for (const column of columns) if (!chips.has(surfaceOf(column))) chips.set(surfaceOf(column), column);
  byId("candidates").replaceChildren(...[...chips].map(([name, column]) => {
    const item = document.createElement("li");
    Object.assign(item.dataset, { name, column, label: name.replaceAll("_", " ") });
    item.textContent = item.dataset.label;
    return item;
  }));
}

const MARKS = { alarm: "▲", named: "◆", broken: "✕", repaired: "✓", supervisor: "⇄", lost: "✖", saved: "⤓", gust: "≋", autopilot: "➤", changed: "⇆", game: "★", flight: "✈", candidates: "…" };

const LETTERS = { broken: "F", alarm: "D", named: "I" }; // fault, detection, isolation: lines in the charts

export function addEvents(events) {
  const list = byId("events");
  for (const { t, kind, says, by } of events) {
    if (kind in LETTERS) flight.instants = [...(flight.instants ?? []), { t, letter: LETTERS[kind] }].slice(-20);
    const item = document.createElement("li");
    const time = Object.assign(document.createElement("time"), { textContent: `${t.toFixed(2)} s` });
    item.append(time, Object.assign(document.createElement("b"), { textContent: `${MARKS[kind] ?? "·"} ${kind}` }), document.createTextNode(by ? `${says}, by ${by}` : says));
    list.prepend(item);
  }
  while (list.children.length > 300) list.lastChild.remove();
}

export function forgetEvents() {
  byId("events").replaceChildren();
  flight.instants = [];
}

export function showTab(name, focus = false) {
  for (const tab of document.querySelectorAll("[role=tab]")) {
    const chosen = tab.id === `tab-${name}`;
    tab.setAttribute("aria-selected", chosen);
    tab.tabIndex = chosen ? 0 : -1;
    byId(tab.getAttribute("aria-controls")).hidden = !chosen;
    if (chosen && focus) tab.focus();
  }
}

export function wireTabs() {
  const tabs = [...document.querySelectorAll("[role=tab]")];
  const beside = (tab, step) => {
    const shown = tabs.filter((each) => each.offsetParent); // a guest has fewer
    return shown.at((shown.indexOf(tab) + step) % shown.length).id.slice(4);
  };
  tabs.forEach((tab) => {
    tab.addEventListener("click", () => showTab(tab.id.slice(4)));
    tab.addEventListener("keydown", (event) => {
      if (event.key === "ArrowRight") showTab(beside(tab, 1), true);
      if (event.key === "ArrowLeft") showTab(beside(tab, -1), true);
      if (event.key.startsWith("Arrow")) event.stopPropagation();
    });
  });
}

let clearing = 0;

export function notice(text) {
  byId("says").textContent = text;
  clearTimeout(clearing);
  clearing = setTimeout(() => { byId("says").textContent = ""; }, 12000);
}
