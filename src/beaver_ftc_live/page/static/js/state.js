// What the page knows of the flight: the hello, the newest frame by column, the seldom changing state; and
// of itself if it is a guest's: number, name, is_invited.

export const flight = { hello: null, frame: null, state: null, you: null, at: new Map(), met: 0 };
export const mayBreak = () => !flight.you || flight.you.is_invited;

export function meet(hello) {
  flight.hello = hello;
  flight.frame = null;
  flight.met += 1;
  flight.at = new Map(hello.columns.map((name, i) => [name, i]));
}

// The value of a log column in the newest frame; null where it is hidden or there is none.
export function value(name) {
  const i = flight.at.get(name);
  return i === undefined || !flight.frame ? null : flight.frame.v[i];
}

// The cases of damage that have struck.
export const damages = () => (flight.state?.faults ?? []).filter(({ type }) => type === "damage").map((fault) => fault.case);

export const AXES = ["p", "q", "r"];
export const DEG = 180 / Math.PI;

export function degrees(name) {
  const rad = value(name);
  return rad === null ? null : rad * DEG;
}
