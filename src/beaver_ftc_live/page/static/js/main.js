// The page: what the flight says goes into `state`; everything is drawn from there, once a screen frame.

import { drawBroken, meetSurfaces, openMenu, wireMenu, wireSensors } from "./breaking.js";
import { Charts } from "./charts.js";
import { drawControls, meetControls, wireControls } from "./controls.js";
import { drawGame, meetGame, wireGame } from "./game.js";
import { Instruments } from "./instruments.js";
import { wireClass } from "./class.js";
import { connect, on, traffic } from "./link.js";
import { addEvents, drawDiagnosis, forgetEvents, meetDiagnosis, notice, wireTabs } from "./panels.js";
import { View } from "./scene.js";
import { flight, mayBreak, meet, value } from "./state.js";
import { Sticks } from "./sticks.js";

const byId = (id) => document.getElementById(id);
const view = new View(byId("scene"), (...place) => { if (mayBreak()) openMenu(...place); });
const charts = new Charts(byId("charts"));
const instruments = new Instruments(byId("attitude"), byId("numbers"));
const sticks = new Sticks();
const drawn = { frames: 0, ms: 0, second: 0, inSecond: 0 };
const SLOW_FPS = 30;
let fresh = false;

on("hello", (hello) => {
  meet(hello);
  for (const greet of [meetSurfaces, meetDiagnosis, meetGame, meetControls]) greet(hello);
  view.meet(hello);
  charts.meet(hello);
  forgetEvents();
  addEvents(hello.events);
});
on("f", (frame) => {
  if (!flight.hello || frame.v.length !== flight.hello.columns.length) return;
  flight.frame = frame;
  fresh = true;
  charts.take();
});
on("s", (state) => {
  flight.state = state;
  drawControls(state);
  drawBroken();
  drawGame();
  const next = flight.you ? "" : " Save it, or press Reset for a new one.";
  banner(state.over ? `The flight is over.${next}` : "");
});
on("e", ({ events }) => addEvents(events));
on("ack", ({ n, ok, says }) => { if (!n && !ok) notice(says); }); // what went wrong without being asked for
on("link", ({ up }) => {
  const waiting = flight.hello ? "" : "The flight is being prepared; the first one on a machine is compiled, which takes a while.";
  banner(up ? waiting : "Not connected: the server has ended, or the network is lost; this page tries again.");
});

function banner(text) {
  byId("banner").hidden = !text;
  if (byId("banner").textContent !== text) byId("banner").textContent = text;
}

function draw(now) {
  requestAnimationFrame(draw);
  sticks.draw(now);
  if (!flight.frame) return;
  count(now);
  const start = performance.now();
  view.draw();
  charts.draw();
  if (fresh) drawNumbers(now);
  drawn.ms += performance.now() - start;
}

function drawNumbers(now) {
  fresh = false;
  instruments.draw(now);
  drawDiagnosis();
  byId("time").textContent = `${value("t_s").toFixed(1)} s`;
}

// Frames drawn, and a softer view after a slow second.
function count(now) {
  drawn.frames += 1;
  drawn.inSecond += 1;
  if (now - drawn.second < 1000) return;
  if (drawn.second && drawn.inSecond < SLOW_FPS && !document.hidden) view.soften();
  drawn.second = now;
  drawn.inSecond = 0;
}

wireTabs();
wireMenu();
wireSensors();
wireGame();
wireControls(view, sticks);
wireClass();
connect();
requestAnimationFrame(draw);

// For tests and measurements: what is shown, and how often.
window.cockpit = { flight, value, drawn, traffic };
