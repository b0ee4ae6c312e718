// A class: whoever flies sees the guests and lets them break; a guest gives a name, and looks on until then.

import { drawBroken, perform } from "./breaking.js";
import { on, refuseWhat } from "./link.js";
import { showTab } from "./panels.js";
import { flight, mayBreak } from "./state.js";

const byId = (id) => document.getElementById(id);
const GUESTS_OWN = ["name", "break", "repair", "blow"];

export function wireClass() {
  on("class", drawClass);
  on("you", drawYou);
  refuseWhat((what) => {
    if (!flight.you || what === "name") return "";
    if (!GUESTS_OWN.includes(what)) return "guests do not fly";
    return mayBreak() ? "" : "you are watching until you are invited";
  });
  byId("let-all").addEventListener("click", () => perform({ do: "let", on: true }));
  byId("let-none").addEventListener("click", () => perform({ do: "let", on: false }));
  byId("you").addEventListener("submit", (event) => {
    event.preventDefault();
    if (byId("name").value.trim()) perform({ do: "name", name: byId("name").value }).then(() => byId("name").blur());
  });
}

function drawClass({ guests, wrong }) {
  const list = byId("guests"), here = guests.filter(({ pages }) => pages).length;
  byId("tab-class").hidden = false;
  while (list.children.length < guests.length) list.append(row(guests[list.children.length].number));
  guests.forEach((guest, i) => drawGuest(list.children[i], guest));
  byId("class-says").textContent = `${here} of ${guests.length} guests are here, ${guests.filter((guest) => guest.is_invited).length} may break.`
    + (wrong ? ` Wrong addresses tried: ${wrong}.` : "");
}

function row(number) {
  const item = document.createElement("li"), button = Object.assign(document.createElement("button"), { type: "button" });
  button.addEventListener("click", () => perform({ do: "let", guest: number, on: button.getAttribute("aria-pressed") !== "true" }));
  item.append(document.createElement("span"), document.createElement("small"), button);
  return item;
}

function drawGuest(item, { number, name, pages, is_invited: invited }) {
  const [who, where, button] = item.children;
  item.classList.toggle("away", !pages);
  who.textContent = name || `guest ${number}`;
  where.textContent = `${name ? `guest ${number}, ` : ""}${pages ? "here" : "away"}${pages > 1 ? `, ${pages} pages` : ""}`;
  button.textContent = invited ? "take back" : "let break";
  button.setAttribute("aria-label", `${who.textContent} (guest ${number}): ${button.textContent}`);
  button.setAttribute("aria-pressed", invited);
}

function drawYou(you) {
  const before = mayBreak();
  flight.you = you;
  document.body.classList.add("guest");
  byId("you").hidden = false;
  if (document.activeElement !== byId("name")) byId("name").value = you.name;
  byId("invited").textContent = you.is_invited ? "You may break it: choose a surface, or a button under Break." : "You look on. Whoever flies may let you break.";
  byId("invited").classList.toggle("on", you.is_invited);
  byId("panel-break").inert = !you.is_invited;
  if (you.is_invited && !before) showTab("break");
  drawBroken();
}
