// The header, the form of a new flight, and the keyboard.

import { openMenu, perform, repair } from "./breaking.js";
import { ask } from "./link.js";
import { notice, showTab } from "./panels.js";
import { flight, mayBreak } from "./state.js";

const byId = (id) => document.getElementById(id);

export function wireControls(view, sticks) {
  byId("pause").addEventListener("click", pause);
  byId("speed").addEventListener("change", (event) => perform({ do: "speed", times: Number(event.target.value) }));
  byId("reset").addEventListener("click", () => perform({ do: "fresh" }));
  byId("save").addEventListener("click", save);
  byId("help").addEventListener("click", help);
  byId("repair-all").addEventListener("click", () => repair());
  byId("gust-up").addEventListener("click", () => perform({ do: "blow", velocity_mps: [0, 0, -6] }));
  byId("gust-side").addEventListener("click", () => perform({ do: "blow", velocity_mps: [0, 6, 0] }));
  byId("invite").addEventListener("click", invite);
  byId("fresh").addEventListener("submit", fresh);
  byId("change").addEventListener("click", change);
  byId("renew").addEventListener("click", () => perform({ do: "change", scheme: flight.state.flying.scheme }));
  byId("aim").addEventListener("submit", aim);
  byId("autopilot-on").addEventListener("click", () => perform({ do: "fresh", autopilot: true }));
  document.addEventListener("keydown", (event) => keyDown(event, view, sticks));
  document.addEventListener("keyup", (event) => sticks.release(event.key.toLowerCase()));
}

const pause = () => perform({ do: "pause", on: !flight.state?.paused });
const help = () => byId("help-text").showModal();

async function save() {
  notice("saving; the flight waits");
  byId("save").disabled = true;
  await perform({ do: "save" });
  byId("save").disabled = false;
}

async function invite() {
  try {
    const address = await ask({ do: "invite" });
    await navigator.clipboard?.writeText(address).catch(() => {});
    notice(`for one other browser, which may then do all that you may: ${address}`);
  } catch (error) { notice(error.message); }
}

function fresh(event) {
  event.preventDefault();
  const asked = Object.fromEntries([...new FormData(event.target)].filter(([, chosen]) => chosen));
  if (asked.autopilot) asked.autopilot = asked.autopilot === "on";
  perform({ do: "fresh", ...asked });
}

function aim(event) {
  event.preventDefault();
  const given = [...new FormData(event.target)].filter(([, text]) => text !== "");
  if (!given.length) { notice("type a value first"); return; }
  perform({ do: "aim", ...Object.fromEntries(given.map(([name, text]) => [name, Number(text)])) });
}

export function meetControls(hello) {
  choices("scenario", hello.scenarios, hello.scenario);
  choices("law", hello.laws, hello.law);
  choices("scheme", hello.schemes, hello.scheme);
  for (const input of byId("aim").querySelectorAll("input")) input.disabled = !hello.autopilot.includes(input.name);
  byId("aim").querySelector("[type=submit]").disabled = !hello.autopilot.length;
  byId("autopilot-on").hidden = hello.autopilot.length > 0;
  byId("description").textContent = `Aircraft ${hello.aircraft}. ${hello.description}`;
}

function choices(name, values, chosen) {
  const select = byId("fresh").elements[name];
  select.replaceChildren(...values.map((each) => new Option(each, each, false, each === chosen)));
}

export function drawControls(state) {
  byId("pause").textContent = state.paused ? "Go on" : "Pause";
  const select = byId("speed");
  if (document.activeElement !== select) select.value = String(state.speed);
  const late = state.achieved < 0.9 * state.speed && !state.paused && !state.over;
  byId("pace").textContent = state.paused ? "paused" : state.over ? "over"
    : `${state.achieved.toFixed(state.achieved < 10 ? 1 : 0)}x${late ? " (machine too slow)" : ""}, jitter ${state.jitter_ms.toFixed(1)} ms`
      + (state.pages > 1 ? `, ${state.pages} pages` : "");
  byId("gust-up").disabled = byId("gust-side").disabled = state.gust;
  byId("change").disabled = byId("renew").disabled = state.over || state.game.phase === "waiting";
  drawFlying(state.flying);
}

// What the form asks for and the flight does not do yet; what a form leaves as it is stays.
function change() {
  const form = new FormData(byId("fresh")), flying = flight.state?.flying ?? {};
  const asked = ["law", "scheme", "sensors"].map((key) => [key, form.get(key)]).filter(([key, chosen]) => chosen && chosen !== flying[key]);
  if (asked.length) perform({ do: "change", ...Object.fromEntries(asked) });
  else notice("nothing to change: choose another law, diagnosis or sensors");
}

function drawFlying({ law, scheme, sensors }) {
  const text = `In charge: law ${law}, diagnosis ${scheme}${sensors ? `, sensors ${sensors}` : ""}.`;
  if (byId("flying").textContent !== text) byId("flying").textContent = text;
}

function keyDown(event, view, sticks) {
  const typing = /^(INPUT|SELECT|TEXTAREA)$/.test(event.target.tagName);
  if (typing || event.ctrlKey || event.altKey || event.metaKey || byId("help-text").open) return;
  const key = event.key.toLowerCase();
  if (sticks.hold(key, event)) return;
  if (key === " " && event.target.tagName !== "BUTTON") { event.preventDefault(); pause(); }
  else if (key === "r") perform({ do: "fresh" });
  else if (key === "c") view.nextCamera();
  else if (key === "?") help();
  else if (key === "0") repair();
  else if (key >= "1" && key <= "8") chooseByKey(Number(key) - 1);
}

function chooseByKey(i) {
  const surface = flight.hello?.surfaces[i];
  if (!surface || !mayBreak()) return;
  showTab("break");
  openMenu(surface, innerWidth / 3, innerHeight / 4);
}
