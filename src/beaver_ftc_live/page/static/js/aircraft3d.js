// A high-wing single-engined aircraft of simple bodies, or a jet (jet3d.js); x forward, y up, z right, metres.
// Each surface is a group that turns about its hinge, with an outline where it is commanded to be.

import * as THREE from "../vendor/three.min.js";
import { box, paint, panel, BROKEN, DARK, HULL, MOVING, WING } from "./bodies3d.js";
import { buildJet, GONE } from "./jet3d.js";

function fuselage() {
  const group = new THREE.Group();
  const outline = [[0.02, -5.1], [0.28, -4.6], [0.42, -3], [0.62, -0.8], [0.72, 0.6], [0.68, 2.0], [0.62, 2.9], [0.5, 3.35], [0.02, 3.45]];
  const hull = new THREE.Mesh(new THREE.LatheGeometry(outline.map(([r, x]) => new THREE.Vector2(r, x)), 20), paint(HULL));
  hull.rotation.z = -Math.PI / 2;
  group.add(hull, box([2.3, 0.55, 1.1], [0.9, 0.55, 0], paint(DARK)), box([1.1, 0.08, 0.9], [-0.8, 0.62, 0], paint(HULL)));
  const spinner = new THREE.Mesh(new THREE.SphereGeometry(0.22, 12, 8), paint(DARK));
  spinner.position.set(3.5, 0, 0);
  group.add(spinner);
  for (const side of [-1, 1]) {
    const strut = new THREE.Mesh(new THREE.CylinderGeometry(0.05, 0.05, 3.0, 6), paint(WING));
    strut.position.set(0.9, 0.15, side * 1.75);
    strut.rotation.x = -side * Math.atan2(2.4, 1.55) * -1;
    const float = new THREE.Mesh(new THREE.CapsuleGeometry(0.3, 5.2, 4, 10), paint(WING));
    float.position.set(0.5, -1.75, side * 1.25);
    float.rotation.z = Math.PI / 2;
    group.add(strut, float, box([0.09, 1.4, 0.09], [1.6, -1.0, side * 0.95], paint(DARK)), box([0.09, 1.4, 0.09], [-0.7, -1.0, side * 0.95], paint(DARK)));
  }
  return group;
}

function wings() {
  const group = new THREE.Group(), white = paint(WING);
  group.add(box([1.2, 0.2, 14.6], [0.95, 0.95, 0], white));
  group.add(box([0.65, 0.1, 4.6], [-4.55, 0.35, 0], white));
  group.add(box([0.75, 1.5, 0.12], [-4.5, 1.05, 0], white), box([0.5, 0.5, 0.1], [-3.9, 0.5, 0], white));
  return group;
}

const PLACES = {
  aileron: [[[0.35, 0.95, 5.6], [0.45, 0.12, 3.2], "z", 1], [[0.35, 0.95, -5.6], [0.45, 0.12, 3.2], "z", -1]],
  flap: [[[0.35, 0.95, 2.4], [0.5, 0.12, 2.9], "z", 1], [[0.35, 0.95, -2.4], [0.5, 0.12, 2.9], "z", 1]],
  elevator: [[[-4.88, 0.35, 0], [0.6, 0.09, 4.6], "z", 1]],
  rudder: [[[-4.88, 1.0, 0], [0.6, 1.7, 0.1], "y", -1]],
};

// Where a surface of this name sits: by its kind, and by its side where its name has one.
function placesOf(name) {
  const kind = Object.keys(PLACES).find((word) => name.includes(word));
  const places = kind ? PLACES[kind] : [];
  if (name.includes("left")) return places.filter(([hinge]) => hinge[2] < 0).map(([h, s, a]) => [h, s, a, 1]);
  if (name.includes("right")) return places.filter(([hinge]) => hinge[2] > 0);
  return places;
}

export function buildAircraft(surfaces) {
  if (surfaces.some((name) => /spoiler|stabiliser/.test(name))) return buildJet(surfaces);
  const root = new THREE.Group();
  root.add(fuselage(), wings());
  const panels = surfaces.flatMap((name) => placesOf(name).map((place) => panel(name, ...place)));
  for (const { place } of panels) root.add(place);
  const disc = new THREE.Mesh(new THREE.CircleGeometry(1.3, 24), new THREE.MeshBasicMaterial({ color: 0x40505c, transparent: true, opacity: 0.25, side: THREE.DoubleSide }));
  disc.rotation.y = Math.PI / 2;
  disc.position.x = 3.55;
  root.add(disc);
  return { root, panels, parts: {} };
}

// Turn the surfaces; deflections in rad by name, commanded and effective (null: hidden, drawn as commanded).
export function deflect(panels, commanded, effective, broken) {
  for (const { name, group, mesh, wanted, axis, sign } of panels) {
    const asked = commanded(name) ?? 0;
    group.rotation[axis] = sign * (effective(name) ?? asked);
    wanted.rotation[axis] = sign * asked;
    mesh.material.color.setHex(broken.has(name) ? BROKEN : MOVING);
  }
}

// Leave out what damage has taken: the surfaces on each case's list, and the part they were on.
export function dismember({ panels, parts }, cases, takes) {
  const lost = new Set(cases.flatMap((name) => takes[name] ?? [])), gone = new Set(cases.flatMap((name) => GONE[name] ?? []));
  for (const { name, place } of panels) place.visible = name === "stabiliser" || !lost.has(name);
  for (const [name, part] of Object.entries(parts)) part.visible = !gone.has(name);
}
