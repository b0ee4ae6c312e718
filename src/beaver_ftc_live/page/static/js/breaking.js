// Breaking and repairing: one set of buttons a surface, and the same as a menu where the aircraft is clicked.

import { ask } from "./link.js";
import { notice } from "./panels.js";
import { damages, flight, mayBreak } from "./state.js";

const kinds = () => flight.hello?.breaks ?? []; // [label, fault]: the rows of the fault types
const byId = (id) => document.getElementById(id);

export function perform(request) {
  return ask(request).then((says) => { if (says) notice(says); return says; }, (error) => { notice(error.message); });
}

const faultsOf = (surface) => (flight.state?.faults ?? []).filter((fault) => fault.actuator === surface);

// Whether a surface is broken in just this way now, whoever broke it.
function isThere(surface, kind) {
  return faultsOf(surface).some((fault) => Object.entries(kind).every(([key, size]) => fault[key] === size));
}

const toggle = (surface, kind) => (isThere(surface, kind) ? repair(surface) : perform({ do: "break", fault: { ...kind, actuator: surface } }));

export const repair = (surface = null) => perform({ do: "repair", actuator: surface });

function buttons(surface) {
  const made = kinds().map(([label, fault]) => {
    const button = Object.assign(document.createElement("button"), { textContent: label, type: "button" });
    button.dataset.label = label;
    button.setAttribute("aria-label", `${surface}: ${label}`);
    button.addEventListener("click", () => { closeMenu(); toggle(surface, fault); });
    return button;
  });
  const mend = Object.assign(document.createElement("button"), { textContent: "repair", type: "button" });
  mend.setAttribute("aria-label", `${surface}: repair`);
  mend.addEventListener("click", () => { closeMenu(); repair(surface); });
  return [...made, mend];
}

// A button a case of damage that the aircraft declares; pressed again, all of it is repaired.
function meetDamage(cases) {
  byId("damage").hidden = !cases.length;
  byId("damage").replaceChildren(Object.assign(document.createElement("legend"), { textContent: "Damage" }), ...cases.map((name) => {
    const button = Object.assign(document.createElement("button"), { textContent: name.replaceAll("-", " "), type: "button" });
    button.dataset.case = name;
    button.addEventListener("click", () => (damages().includes(name) ? repair("damage") : perform({ do: "break", fault: { type: "damage", case: name } })));
    return button;
  }));
}

export function meetSurfaces(hello) {
  meetDamage(Object.keys(hello.damage));
  byId("sensor").replaceChildren(...hello.sensors.map((name) => new Option(name.replaceAll("_", " "), name)));
  byId("surfaces").replaceChildren(...hello.surfaces.map((surface, i) => {
    const group = document.createElement("fieldset");
    group.dataset.surface = surface;
    const title = Object.assign(document.createElement("legend"), { textContent: `${i + 1} ${surface}` });
    title.append(document.createElement("em"));
    group.append(title, ...buttons(surface));
    return group;
  }));
}

// Sizes that can be seen and flown with, in the unit in which a scenario has the sensor.
const SIZES = { p: 3, q: 3, r: 3, alpha: 3, beta: 3, V: 6, qdyn: 200, phi: 8, theta: 8, psi: 8, altitude: 60, engine_rpm: 300, manifold_pressure: 4, ax: 3, ay: 3, az: 5 };
const SENSOR_KINDS = [
  ["bias", (size) => ({ type: "bias", magnitude: size })],
  ["noise", (size) => ({ type: "noise", magnitude: size })],
  ["scale +33 %", () => ({ type: "scale", magnitude: 0.33 })],
  ["freeze", () => ({ type: "freeze" })],
  ["lost", () => ({ type: "lost" })],
];

export function wireSensors() {
  byId("sensor-fault").replaceChildren(...SENSOR_KINDS.map(([label], i) => new Option(label, i)));
  byId("sensor-break").addEventListener("click", () => {
    const sensor = byId("sensor").value, [, fault] = SENSOR_KINDS[Number(byId("sensor-fault").value)];
    perform({ do: "break", fault: { sensor, ...fault(SIZES[sensor] ?? 1) } });
  });
  byId("sensor-repair").addEventListener("click", () => repair(byId("sensor").value));
}

const inWords = ({ type, by }) => type.replaceAll("_", " ") + (by ? ` by ${by}` : "");

function drawSensors(broken) {
  const faults = flight.state?.faults ?? [], by = (name) => faults.find(({ sensor }) => sensor === name)?.by;
  const off = (flight.hello?.sensors ?? []).filter((name) => broken.has(name)).map((name) => (by(name) ? `${name} by ${by(name)}` : name)), says = byId("sensors").querySelector("em");
  says.hidden = !off.length;
  if (says.textContent !== `✕ ${off.join(", ")}`) says.textContent = `✕ ${off.join(", ")}`;
  byId("sensors").classList.toggle("broken", off.length > 0);
}

export function drawBroken() {
  const broken = new Set(flight.state?.broken ?? []);
  drawSensors(broken);
  drawLegend([...broken].flatMap((name) => (name === "damage" ? damages().map((of) => of.replaceAll("-", " ")) : [name])));
  for (const button of byId("damage").querySelectorAll("button")) button.setAttribute("aria-pressed", damages().includes(button.dataset.case));
  for (const group of byId("surfaces").children) {
    const surface = group.dataset.surface;
    const says = broken.has(surface) ? ` ✕ broken: ${[...new Set(faultsOf(surface).map(inWords))].join(", ")}` : "";
    group.classList.toggle("broken", broken.has(surface));
    if (group.querySelector("em").textContent !== says) group.querySelector("em").textContent = says;
    for (const [label, kind] of kinds()) group.querySelector(`[data-label="${label}"]`).setAttribute("aria-pressed", isThere(surface, kind));
  }
}

// What is broken is red in the view; said in words beside it.
function drawLegend(broken) {
  const legend = byId("legend"), whole = mayBreak() ? "click a surface to break it" : "you are watching";
  const text = broken.length ? `✕ broken: ${broken.join(", ")}` : whole;
  if (legend.textContent !== text) legend.textContent = text;
  legend.classList.toggle("broken", broken.length > 0);
}

let opener = null;

export function openMenu(surface, x, y) {
  const menu = byId("menu");
  if (!surface) { closeMenu(); return; }
  opener = document.activeElement;
  menu.replaceChildren(Object.assign(document.createElement("b"), { textContent: surface }), ...buttons(surface));
  for (const button of menu.querySelectorAll("button")) button.setAttribute("role", "menuitem");
  menu.hidden = false;
  menu.style.left = `${Math.max(4, Math.min(x, innerWidth - 190))}px`;
  menu.style.top = `${Math.max(4, Math.min(y, innerHeight - menu.offsetHeight - 8))}px`;
  menu.querySelector("button").focus({ preventScroll: true });
}

export function closeMenu() {
  if (byId("menu").hidden) return;
  byId("menu").hidden = true;
  opener?.focus?.({ preventScroll: true });
}

export function wireMenu() {
  const menu = byId("menu");
  menu.addEventListener("keydown", (event) => {
    const items = [...menu.querySelectorAll("button")], i = items.indexOf(document.activeElement);
    if (event.key === "ArrowDown") items[(i + 1) % items.length].focus();
    if (event.key === "ArrowUp") items[(i + items.length - 1) % items.length].focus();
    if (event.key === "Escape" || event.key === "Tab") closeMenu();
    event.stopPropagation();
  });
  document.addEventListener("pointerdown", (event) => {
    if (!menu.hidden && !menu.contains(event.target)) closeMenu();
  });
}
