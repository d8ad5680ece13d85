// The surface as three.js draws it: the keyframe's triangles, and a patch of smaller ones in place of some.
import * as THREE from "three";
import { colourOf } from "./colour";
import type { Patch } from "./refined";
import type { Surface } from "./surface";

export class Skin {
  readonly geometry = new THREE.BufferGeometry();
  /** Drawn from the next refresh on. */
  patch: Patch | undefined;
  private replaced: Uint32Array = new Uint32Array();

  constructor(private readonly surface: Surface) {
    this.makeRoom(surface.displacement.length, surface.triangles.length);
    this.attribute("index").array.set(surface.triangles);
  }

  /** Takes over positions and colours; `top` is the displacement (m) of the last colour. */
  refresh(top: number): void {
    const { surface, patch } = this;
    const own = surface.displacement.length;
    const indices = surface.triangles.length + (patch ? patch.triangles.length - 3 * patch.replaced.length : 0);
    if (patch || this.replaced.length > 0) this.layOut(own + (patch?.displacement.length ?? 0), indices);
    const positions = this.attribute("position");
    positions.array.set(surface.positions);
    if (patch) positions.array.set(patch.positions, surface.positions.length);
    positions.needsUpdate = true;
    const colours = this.attribute("color");
    const colour = new THREE.Color();
    const paint = (d: number, vertex: number) => {
      const [r, g, b] = colourOf(d / top);
      colour.setRGB(r, g, b, THREE.SRGBColorSpace);
      colours.setXYZ(vertex, colour.r, colour.g, colour.b);
    };
    surface.displacement.forEach(paint);
    patch?.displacement.forEach((d, vertex) => paint(d, own + vertex));
    colours.needsUpdate = true;
    this.geometry.computeVertexNormals();
  }

  /** The patch's triangles in the places of those that they replace, the others behind. */
  private layOut(vertices: number, indices: number): void {
    const { surface, patch } = this;
    this.makeRoom(vertices, indices);
    const index = this.attribute("index");
    for (const triangle of this.replaced) index.array.set(surface.triangles.subarray(3 * triangle, 3 * triangle + 3), 3 * triangle);
    this.replaced = patch?.replaced ?? new Uint32Array();
    const small = patch?.triangles ?? new Uint32Array();
    this.replaced.forEach((triangle, i) => index.array.set(small.subarray(3 * i, 3 * i + 3), 3 * triangle));
    index.array.set(small.subarray(3 * this.replaced.length), surface.triangles.length);
    // What lies behind is not drawn, but has a part in the normals.
    index.array.fill(0, indices);
    index.needsUpdate = true;
    this.geometry.setDrawRange(0, indices);
  }

  /** Arrays only grow: a patch changes with every step of a tool. */
  private makeRoom(vertices: number, indices: number): void {
    const { geometry } = this;
    const room = geometry.index;
    if (room && room.count >= indices && this.attribute("position").count >= vertices) return;
    // A triangle cut short would have no finite normal.
    const grown = (least: number) => (room ? 3 * Math.ceil(0.43 * least) : least);
    // Frees what the graphics card holds of the smaller ones.
    geometry.dispose();
    const index = new THREE.BufferAttribute(new Uint32Array(grown(indices)), 1);
    index.array.set(this.surface.triangles);
    geometry.setIndex(index);
    for (const name of ["position", "color", "normal"]) geometry.setAttribute(name, new THREE.BufferAttribute(new Float32Array(3 * grown(vertices)), 3));
    this.replaced = new Uint32Array();
  }

  private attribute(name: "index" | "position" | "color"): THREE.BufferAttribute {
    return (name === "index" ? this.geometry.index : this.geometry.getAttribute(name)) as THREE.BufferAttribute;
  }
}
