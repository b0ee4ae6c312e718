// Stick and pedals from the screen, the keyboard or a gamepad: rates added to the reference.

import { say } from "./link.js";

const KEYS = { a: [0, -1], d: [0, 1], w: [1, -1], s: [1, 1], q: [2, -1], e: [2, 1] };
const STEP_DEG_S = 0.5, SENT_MS = 50, DEAD = 0.12;
const AT_REST = JSON.stringify({ do: "stick", rates_deg_s: [0, 0, 0], coordinated: false }); // a page that only looks on says nothing
const byId = (id) => document.getElementById(id);

export class Sticks {
  constructor() {
    this.held = new Set();
    this.screen = [0, 0];
    this.sent = "";
    this.next = 0;
    this.pad = byId("stick");
    this.wireScreen();
    byId("reach").addEventListener("input", () => { byId("reach-says").textContent = `${byId("reach").value} deg/s`; });
    byId("pedals").addEventListener("change", () => { byId("pedals").value = 0; });
    window.addEventListener("blur", () => this.held.clear());
  }

  wireScreen() {
    const { pad } = this;
    const move = (event) => {
      const box = pad.getBoundingClientRect();
      const share = (at, from, size) => Math.max(-1, Math.min(1, (2 * (at - from)) / size - 1));
      this.screen = [share(event.clientX, box.left, box.width), share(event.clientY, box.top, box.height)];
    };
    pad.addEventListener("pointerdown", (event) => { pad.setPointerCapture(event.pointerId); move(event); });
    pad.addEventListener("pointermove", (event) => { if (pad.hasPointerCapture(event.pointerId)) move(event); });
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) pad.addEventListener(end, () => { this.screen = [0, 0]; });
    const arrows = { ArrowLeft: "a", ArrowRight: "d", ArrowUp: "w", ArrowDown: "s" };
    pad.addEventListener("keydown", (event) => this.hold(arrows[event.key], event));
    pad.addEventListener("keyup", (event) => this.held.delete(arrows[event.key]));
  }

  hold(key, event) {
    if (!(key in KEYS)) return false;
    this.held.add(key);
    event.preventDefault();
    return true;
  }

  release(key) {
    this.held.delete(key);
  }

  // Shares of full stick: roll, pitch (back is up), yaw.
  shares() {
    const sum = [this.screen[0], this.screen[1], Number(byId("pedals").value)];
    for (const key of this.held) if (KEYS[key]) sum[KEYS[key][0]] += KEYS[key][1];
    const pad = navigator.getGamepads?.().find((found) => found?.connected);
    if (pad) [0, 1, 2].forEach((i) => { const x = pad.axes[i] ?? 0; if (Math.abs(x) > DEAD) sum[i] += x; });
    return sum.map((x) => Math.max(-1, Math.min(1, x)));
  }

  // Send what has changed, twenty times a second at most, in steps: every change is a row of the saved scenario.
  draw(now) {
    if (now < this.next) return;
    this.next = now + SENT_MS;
    const reach = Number(byId("reach").value), shares = this.shares();
    byId("knob").style.transform = `translate(${shares[0] * 41}px, ${shares[1] * 41}px)`;
    const rates = shares.map((share) => Math.round((share * reach) / STEP_DEG_S) * STEP_DEG_S);
    const request = { do: "stick", rates_deg_s: rates, coordinated: byId("coordinated").checked };
    const text = JSON.stringify(request);
    if (text === this.sent || (!this.sent && text === AT_REST)) return;
    this.sent = text;
    say(request);
    byId("stick-says").textContent = rates.some(Boolean) ? `roll ${rates[0]}, pitch ${rates[1]}, yaw ${rates[2]} deg/s` : "centred";
  }
}
