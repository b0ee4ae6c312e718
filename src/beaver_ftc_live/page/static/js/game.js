// You against the detector.

import { perform } from "./breaking.js";
import { flight } from "./state.js";

const byId = (id) => document.getElementById(id);

export function wireGame() {
  byId("game-random").addEventListener("click", () => perform({ do: "game", move: "random" }));
  byId("game-second").addEventListener("click", () => perform({ do: "game", move: "second" }));
  byId("game-stop").addEventListener("click", () => perform({ do: "game", move: "stop" }));
}

export function meetGame(hello) {
  byId("answers").replaceChildren(...hello.surfaces.map((name) => {
    const button = Object.assign(document.createElement("button"), { textContent: name });
    button.addEventListener("click", () => perform({ do: "game", move: "answer", answer: name }));
    return button;
  }));
}

export function drawGame() {
  const game = flight.state?.game;
  if (!game) return;
  const on = game.phase === "waiting";
  byId("answers").hidden = !on || game.answered;
  byId("game-stop").hidden = !on;
  byId("game-random").hidden = byId("game-second").hidden = on;
  const says = text(game);
  if (byId("game-says").textContent !== says) byId("game-says").textContent = says;
}

function text(game) {
  const score = `You ${game.score[0]}, detector ${game.score[1]}.`;
  if (game.phase === "waiting") {
    if (game.answered) return "Waiting for the diagnosis.";
    return game.mode === "second" ? "Let the other one break something, then name it." : "Something will break. Name the surface as soon as you know it.";
  }
  if (game.phase !== "over") return score;
  if (game.broken_s === null || game.broken_s === undefined) return `Nothing had been broken. ${score}`;
  const fault = `It was the ${game.fault.actuator}: ${game.fault.type.replaceAll("_", " ")} at ${game.broken_s.toFixed(1)} s.`;
  const time = (said, delay) => !said ? "said nothing" : delay === null ? `said ${said[0]}: wrong` : `said ${said[0]} after ${delay.toFixed(2)} s`;
  const winner = { you: "You win.", detector: "The detector wins." }[game.winner] ?? "Nobody wins.";
  return `${fault} You ${time(game.yours, game.your_delay_s)}. The detector ${time(game.detector, game.its_delay_s)}. ${winner} ${score}`;
}
