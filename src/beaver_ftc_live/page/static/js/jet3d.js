// A low-wing twin jet for aircraft with spoilers or a stabiliser, such as NASA's transport model: drawn as large
// as the Beaver. Each part that damage may take is a group by its name, with the surfaces on it.

import * as THREE from "../vendor/three.min.js";
import { box, paint, panel, HULL, WING, DARK } from "./bodies3d.js";

// What goes with a case of damage beside the surfaces that it takes.
export const GONE = { "fin-off": ["fin"], "left-wing-tip-off": ["left_wing_tip"], "left-stabiliser-off": ["left_stabiliser"] };

// A flat body of this plan, [x, z] each; upright: [x, y].
function slab(plan, at, thick, upright = false) {
  const shape = new THREE.Shape(plan.map(([x, across]) => new THREE.Vector2(x, across)));
  const geometry = new THREE.ExtrudeGeometry(shape, { depth: thick, bevelEnabled: false });
  geometry.translate(0, 0, -thick / 2);
  if (!upright) geometry.rotateX(Math.PI / 2);
  const mesh = new THREE.Mesh(geometry, new THREE.MeshLambertMaterial({ color: WING, side: THREE.DoubleSide }));
  mesh.position.set(...at);
  return mesh;
}

const WING_Y = -0.45, TAIL_Y = 0.35, WING_SWEEP = Math.atan2(2.3, 4.8), TAIL_SWEEP = Math.atan2(0.6, 2.5);
const BODY = [[2.4, 0.7], [0.7, 2.7], [-1.2, 5.4], [-2.7, 5.4], [-1.5, 2.7], [-1.5, 0.7]], TIP = [[-1.2, 5.4], [-2.7, 7.6], [-3.75, 7.6], [-2.7, 5.4]];
const HALF_TAIL = [[-6.6, 0.3], [-8.2, 2.9], [-8.75, 2.9], [-8.15, 0.3]], FIN = [[-5.4, 0.7], [-8.1, 3.9], [-8.9, 3.9], [-8.2, 0.7]];

const mirrored = (plan, side) => plan.map(([x, z]) => [x, side * z]);
// Behind the trailing edge of a wing, or of the tail, at z.
const wingEdge = (z) => (z < 2.7 ? -1.5 : -1.5 - (z - 2.7) * Math.tan(WING_SWEEP));
const tailEdge = (z) => -8.15 - (z - 0.3) * Math.tan(TAIL_SWEEP);

// Of the right side: [part of the name, from z, to z, chord, edge, sweep, height, ahead of the edge].
const SIDED = [
  ["inboard_flap", 0.8, 2.6, 0.65, wingEdge, 0, WING_Y, 0], ["outboard_flap", 2.8, 5.2, 0.6, wingEdge, WING_SWEEP, WING_Y, 0],
  ["aileron", 5.6, 7.3, 0.5, wingEdge, WING_SWEEP, WING_Y, 0],
  ["inboard_spoiler", 0.9, 2.5, 0.55, wingEdge, 0, WING_Y + 0.14, 0.7], ["outboard_spoiler", 2.9, 5.0, 0.55, wingEdge, WING_SWEEP, WING_Y + 0.14, 0.7],
  ["inboard_elevator", 0.4, 1.5, 0.5, tailEdge, TAIL_SWEEP, TAIL_Y, 0], ["outboard_elevator", 1.6, 2.7, 0.45, tailEdge, TAIL_SWEEP, TAIL_Y, 0],
];
const RUDDERS = { lower_rudder: [0.75, 2.2], upper_rudder: [2.3, 3.8] };

function sided(surface, side) {
  const word = surface.replace(/^(left|right)_/, ""), place = SIDED.find(([name]) => name === word);
  if (!place) return null;
  const [, from, to, chord, edge, sweep, y, ahead] = place, z = (from + to) / 2, spoils = word.includes("spoiler");
  const long = (to - from) / Math.cos(sweep);
  return panel(surface, [edge(z) + ahead, y, side * z], [chord, 0.08, long], "z", spoils ? -1 : 1, [0, -side * sweep, 0]);
}

function rudder(surface) {
  const [from, to] = RUDDERS[surface], y = (from + to) / 2, sweep = Math.atan2(0.7, 3.2);
  return panel(surface, [-8.2 - (y - 0.7) * Math.tan(sweep), y, 0], [0.6, (to - from) / Math.cos(sweep), 0.1], "y", -1, [0, 0, sweep]);
}

function halfTail(side) {
  const made = panel("stabiliser", [-8.15, TAIL_Y, 0], [1, 0.1, 1], "z", 1);
  const plan = mirrored(HALF_TAIL, side).map(([x, z]) => [x + 8.15, z]);
  const { geometry } = slab(plan, [0, 0, 0], 0.12);
  made.mesh.geometry = geometry;
  made.wanted.geometry = new THREE.EdgesGeometry(geometry);
  return made;
}

function hull() {
  const group = new THREE.Group(), outline = [[0.02, -9.2], [0.3, -8.6], [0.7, -6.2], [0.95, -3.5], [0.95, 5.5], [0.8, 7.2], [0.45, 8.4], [0.02, 8.9]];
  const body = new THREE.Mesh(new THREE.LatheGeometry(outline.map(([r, x]) => new THREE.Vector2(r, x)), 24), paint(HULL));
  body.rotation.z = -Math.PI / 2;
  group.add(body, box([0.9, 0.3, 1.1], [7.2, 0.5, 0], paint(DARK)));
  for (const side of [-1, 1]) {
    const engine = new THREE.Mesh(new THREE.CylinderGeometry(0.5, 0.4, 2.2, 16), paint(DARK));
    engine.rotation.z = -Math.PI / 2;
    engine.position.set(1.1, WING_Y - 0.75, side * 2.6);
    group.add(engine, box([1.4, 0.4, 0.12], [0.6, WING_Y - 0.2, side * 2.6], paint(WING)), slab(mirrored(BODY, side), [0, WING_Y, 0], 0.2));
  }
  return group;
}

export function buildJet(surfaces) {
  const root = new THREE.Group(), parts = {}, panels = [];
  const part = (name, ...bodies) => { parts[name] = new THREE.Group(); parts[name].add(...bodies); root.add(parts[name]); };
  root.add(hull());
  part("fin", slab(FIN, [0, 0, 0], 0.14, true));
  for (const [word, side] of [["left", -1], ["right", 1]]) {
    part(`${word}_wing_tip`, slab(mirrored(TIP, side), [0, WING_Y, 0], 0.16));
    const half = surfaces.includes("stabiliser") ? halfTail(side) : null;
    part(`${word}_stabiliser`, ...(half ? [half.place] : [slab(mirrored(HALF_TAIL, side), [0, TAIL_Y, 0], 0.12)]));
    if (half) panels.push(half);
  }
  for (const surface of surfaces) {
    const made = surface in RUDDERS ? rudder(surface) : sided(surface, surface.startsWith("left") ? -1 : 1);
    if (!made) continue;
    root.add(made.place);
    panels.push(made);
  }
  return { root, panels, parts };
}
