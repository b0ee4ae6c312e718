// Attitude as a drawn horizon, the rest as numbers: numbers change ten times a second, or nobody could read them.

import { AXES, DEG, degrees, value } from "./state.js";

const NUMBERS = [
  ["airspeed", () => [value("airspeed_mps"), 1, "m/s", value("airspeed_command_mps")]],
  ["altitude", () => [value("altitude_m"), 0, "m", value("altitude_command_m")]],
  ["heading", () => [((degrees("psi_rad") % 360) + 360) % 360, 0, "deg"]],
  ["bank", () => [degrees("phi_rad"), 1, "deg"]],
  ["pitch", () => [degrees("theta_rad"), 1, "deg"]],
  ["sideslip", () => [degrees("beta_rad"), 1, "deg"]],
  ...AXES.map((axis, i) => [`${["roll", "pitch", "yaw"][i]} rate ${axis}`, () => [degrees(`${axis}_measured_rad_s`), 1, "deg/s"]]),
];

export class Instruments {
  constructor(canvas, list) {
    this.ink = canvas.getContext("2d");
    this.canvas = canvas;
    this.cells = NUMBERS.map(([name, now]) => {
      const row = document.createElement("div"), cell = document.createElement("dd");
      const title = Object.assign(document.createElement("dt"), { textContent: name });
      row.append(title, cell);
      list.append(row);
      return { cell, now, name, title, text: document.createTextNode("") };
    });
    for (const { cell, text } of this.cells) cell.append(text);
    this.next = 0;
  }

  draw(now) {
    this.drawAttitude(value("phi_rad"), value("theta_rad"));
    if (now < this.next) return;
    this.next = now + 100;
    for (const { now: read, name, title, text } of this.cells) {
      const [number, digits, unit, asked] = read();
      const label = asked === null || asked === undefined ? name : `${name} → ${asked.toFixed(0)}`; // of the autopilot
      if (title.textContent !== label) title.textContent = label;
      text.data = number === null || Number.isNaN(number) ? "-" : `${number.toFixed(digits)} ${unit}`;
    }
  }

  drawAttitude(phi, theta) {
    const { ink } = this, size = this.canvas.width, r = size / 2, perDeg = r / 30;
    ink.save();
    ink.clearRect(0, 0, size, size);
    ink.translate(r, r);
    ink.beginPath();
    ink.arc(0, 0, r - 2, 0, 7);
    ink.clip();
    ink.rotate(-phi);
    ink.translate(0, theta * DEG * perDeg);
    ink.fillStyle = "#4aa3df";
    ink.fillRect(-2 * r, -4 * r, 4 * r, 4 * r);
    ink.fillStyle = "#7a5230";
    ink.fillRect(-2 * r, 0, 4 * r, 4 * r);
    this.drawLadder(perDeg);
    ink.restore();
    this.drawWings(r);
  }

  drawLadder(perDeg) {
    const { ink } = this;
    ink.strokeStyle = ink.fillStyle = "#ffffff";
    ink.lineWidth = 2;
    ink.font = "16px sans-serif";
    for (let pitch = -30; pitch <= 30; pitch += 10) {
      const half = pitch ? 26 : 300;
      ink.beginPath();
      ink.moveTo(-half, -pitch * perDeg);
      ink.lineTo(half, -pitch * perDeg);
      ink.stroke();
      if (pitch) ink.fillText(Math.abs(pitch), half + 4, 5 - pitch * perDeg);
    }
  }

  drawWings(r) {
    const { ink } = this;
    ink.save();
    ink.translate(r, r);
    ink.strokeStyle = "#ffe14d";
    ink.lineWidth = 5;
    ink.beginPath();
    ink.moveTo(-60, 0); ink.lineTo(-20, 0); ink.lineTo(-20, 10);
    ink.moveTo(60, 0); ink.lineTo(20, 0); ink.lineTo(20, 10);
    ink.moveTo(-3, 0); ink.lineTo(3, 0);
    ink.stroke();
    ink.lineWidth = 3;
    ink.strokeStyle = "#ffffff";
    for (const bank of [-60, -30, 0, 30, 60]) {
      const a = (bank - 90) / DEG;
      ink.beginPath();
      ink.moveTo((r - 4) * Math.cos(a), (r - 4) * Math.sin(a));
      ink.lineTo((r - 16) * Math.cos(a), (r - 16) * Math.sin(a));
      ink.stroke();
    }
    ink.restore();
  }
}
