// The websocket: what the flight says goes to listeners by kind; requests are numbered and answered.

const listeners = new Map();
const waiting = new Map();
let socket = null;
let number = 0;
let refused = () => ""; // why a request is not this page's to make: the server would refuse it too
export const traffic = { frames: 0, bytes: 0 };

export function on(kind, listener) {
  if (!listeners.has(kind)) listeners.set(kind, []);
  listeners.get(kind).push(listener);
}

function emit(kind, told) {
  for (const listener of listeners.get(kind) ?? []) listener(told);
}

export function refuseWhat(says) {
  refused = says;
}

export function connect() {
  const place = location.pathname.replace(/[^/]*$/, "socket");
  socket = new WebSocket(`ws://${location.host}${place}`);
  socket.addEventListener("open", () => emit("link", { up: true }));
  socket.addEventListener("message", (message) => receive(message.data));
  socket.addEventListener("close", () => {
    for (const { reject } of waiting.values()) reject(new Error("the connection is lost"));
    waiting.clear();
    emit("link", { up: false });
    setTimeout(connect, 1000);
  });
}

function receive(text) {
  const told = JSON.parse(text);
  traffic.bytes += text.length;
  if (told.k === "f") traffic.frames += 1;
  if (told.k === "ack" && waiting.has(told.n)) {
    const { resolve, reject } = waiting.get(told.n);
    waiting.delete(told.n);
    if (told.ok) resolve(told.says); else reject(new Error(told.says));
  }
  emit(told.k, told);
}

// Ask the flight for something; the promise is its answer in words.
export function ask(request) {
  if (!socket || socket.readyState !== WebSocket.OPEN) return Promise.reject(new Error("not connected"));
  if (refused(request.do)) return Promise.reject(new Error(refused(request.do)));
  number += 1;
  const n = number;
  socket.send(JSON.stringify({ ...request, n }));
  return new Promise((resolve, reject) => waiting.set(n, { resolve, reject }));
}

// Say something that is not answered: the stick.
export function say(request) {
  if (socket && socket.readyState === WebSocket.OPEN && !refused(request.do)) socket.send(JSON.stringify(request));
}
