// Breaking and repairing: one set of buttons a surface, and the same as a menu where the aircraft is clicked.

import { ask } from "./link.js";
import { notice } from "./panels.js";
import { flight } from "./state.js";

const KINDS = [
  ["lose 40 %", { type: "loss_of_effectiveness", magnitude: 0.4 }],
  ["jam", { type: "stuck" }],
  ["float", { type: "float" }],
  ["run away", { type: "hardover", direction: 1 }],
  ["oscillate", { type: "oscillatory", amplitude_deg: 3, frequency_rad_s: 6 }],
  ["bias", { type: "bias", bias_deg: 3 }],
  ["slow", { type: "rate_limit", scale: 0.05 }],
];
const byId = (id) => document.getElementById(id);
const active = new Map(); // surface -> Map of kind -> true, as far as this page did it

export function perform(request) {
  return ask(request).then((says) => { if (says) notice(says); return says; }, (error) => { notice(error.message); });
}

async function toggle(surface, label, fault) {
  const broken = active.get(surface) ?? new Set();
  if (broken.has(label)) return repair(surface);
  if (await perform({ do: "break", fault: { ...fault, actuator: surface } }) === undefined) return undefined;
  active.set(surface, broken.add(label));
  return drawBroken();
}

export async function repair(surface = null) {
  if (await perform({ do: "repair", actuator: surface }) === undefined) return;
  if (surface) active.delete(surface); else active.clear();
  drawBroken();
}

function buttons(surface) {
  const made = KINDS.map(([label, fault]) => {
    const button = Object.assign(document.createElement("button"), { textContent: label, type: "button" });
    button.dataset.label = label;
    button.setAttribute("aria-label", `${surface}: ${label}`);
    button.addEventListener("click", () => { closeMenu(); toggle(surface, label, fault); });
    return button;
  });
  const mend = Object.assign(document.createElement("button"), { textContent: "repair", type: "button" });
  mend.setAttribute("aria-label", `${surface}: repair`);
  mend.addEventListener("click", () => { closeMenu(); repair(surface); });
  return [...made, mend];
}

export function meetSurfaces(hello) {
  active.clear();
  byId("sensor").replaceChildren(...hello.sensors.map((name) => new Option(name.replaceAll("_", " "), name)));
  byId("surfaces").replaceChildren(...hello.surfaces.map((surface, i) => {
    const group = document.createElement("fieldset");
    group.dataset.surface = surface;
    const title = Object.assign(document.createElement("legend"), { textContent: `${i + 1} ${surface}` });
    title.append(Object.assign(document.createElement("em"), { textContent: " ✕ broken" }));
    group.append(title, ...buttons(surface));
    return group;
  }));
}

// Sizes that can be seen and flown with, in the unit in which a scenario has the sensor.
const SIZES = { p: 3, q: 3, r: 3, alpha: 3, beta: 3, V: 6, qdyn: 200, phi: 8, theta: 8, psi: 8, altitude: 60, engine_rpm: 300, manifold_pressure: 4, ax: 3, ay: 3, az: 5 };
const SENSOR_KINDS = [
  ["is off", (size) => ({ type: "bias", magnitude: size })],
  ["scatters", (size) => ({ type: "noise", magnitude: size })],
  ["a third too much", () => ({ type: "scale", magnitude: 0.33 })],
  ["freezes", () => ({ type: "freeze" })],
  ["is lost", () => ({ type: "lost" })],
];

export function wireSensors() {
  byId("sensor-fault").replaceChildren(...SENSOR_KINDS.map(([label], i) => new Option(label, i)));
  byId("sensor-break").addEventListener("click", () => {
    const sensor = byId("sensor").value, [, fault] = SENSOR_KINDS[Number(byId("sensor-fault").value)];
    perform({ do: "break", fault: { sensor, ...fault(SIZES[sensor] ?? 1) } });
  });
  byId("sensor-repair").addEventListener("click", () => repair(byId("sensor").value));
}

function drawSensors(broken) {
  const off = (flight.hello?.sensors ?? []).filter((name) => broken.has(name)), says = byId("sensors").querySelector("em");
  says.hidden = !off.length;
  if (says.textContent !== `✕ ${off.join(", ")}`) says.textContent = `✕ ${off.join(", ")}`;
  byId("sensors").classList.toggle("broken", off.length > 0);
}

export function drawBroken() {
  const broken = new Set(flight.state?.broken ?? []);
  drawSensors(broken);
  drawLegend([...broken]);
  for (const group of byId("surfaces").children) {
    const surface = group.dataset.surface;
    const hidden = flight.state?.game.phase === "waiting";
    group.classList.toggle("broken", broken.has(surface));
    group.querySelector("em").hidden = !broken.has(surface);
    for (const button of group.querySelectorAll("[data-label]")) {
      button.setAttribute("aria-pressed", !hidden && Boolean(active.get(surface)?.has(button.dataset.label)));
    }
  }
}

// What is broken is red in the view; said in words beside it.
function drawLegend(broken) {
  const legend = byId("legend"), text = broken.length ? `✕ broken: ${broken.join(", ")}` : "click a surface to break it";
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
