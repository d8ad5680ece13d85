// The surface as three.js draws it: the keyframe's triangles, and a patch of smaller ones in place of some.
import * as THREE from "three";
import { colourOf } from "./colour";
import { type Creased, creased } from "./creases";
import type { Patch } from "./refined";
import type { Surface } from "./surface";

export class Skin {
  readonly geometry = new THREE.BufferGeometry();
  /** Drawn from the next refresh on. */
  patch: Patch | undefined;
  private replaced: Uint32Array = new Uint32Array();

  /** The surface's vertices, and one more for each further side of a crease. */
  private readonly creased: Creased;

  constructor(private readonly surface: Surface) {
    this.creased = creased(surface.rest, surface.triangles);
    this.makeRoom(this.creased.source.length, surface.triangles.length);
  }

  /** Takes over positions and colours; `top` is the displacement (m) of the last colour. */
  refresh(top: number): void {
    const { surface, patch } = this;
    const { source } = this.creased;
    const own = source.length;
    const indices = surface.triangles.length + (patch ? patch.triangles.length - 3 * patch.replaced.length : 0);
    if (patch || this.replaced.length > 0) this.layOut(own + (patch?.displacement.length ?? 0), indices);
    const positions = this.attribute("position");
    positions.array.set(surface.positions);
    for (let drawn = surface.displacement.length; drawn < own; drawn++) {
      positions.array.copyWithin(3 * drawn, 3 * source[drawn]!, 3 * source[drawn]! + 3);
    }
    if (patch) positions.array.set(patch.positions, 3 * own);
    positions.needsUpdate = true;
    const colours = this.attribute("color");
    const colour = new THREE.Color();
    const paint = (d: number, vertex: number) => {
      const [r, g, b] = colourOf(d / top);
      colour.setRGB(r, g, b, THREE.SRGBColorSpace);
      colours.setXYZ(vertex, colour.r, colour.g, colour.b);
    };
    source.forEach((vertex, drawn) => paint(surface.displacement[vertex]!, drawn));
    patch?.displacement.forEach((d, vertex) => paint(d, own + vertex));
    colours.needsUpdate = true;
    this.geometry.computeVertexNormals();
  }

  /** The patch's triangles in the places of those that they replace, the others behind. */
  private layOut(vertices: number, indices: number): void {
    const { surface, patch } = this;
    const { triangles, source } = this.creased;
    this.makeRoom(vertices, indices);
    const index = this.attribute("index");
    for (const triangle of this.replaced) index.array.set(triangles.subarray(3 * triangle, 3 * triangle + 3), 3 * triangle);
    this.replaced = patch?.replaced ?? new Uint32Array();
    // The patch's own vertices lie behind those of creases.
    const behind = source.length - surface.displacement.length;
    const small = (patch?.triangles ?? new Uint32Array()).map((vertex) => (vertex < surface.displacement.length ? vertex : vertex + behind));
    this.replaced.forEach((triangle, i) => index.array.set(small.subarray(3 * i, 3 * i + 3), 3 * triangle));
    index.array.set(small.subarray(3 * this.replaced.length), triangles.length);
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
    index.array.set(this.creased.triangles);
    geometry.setIndex(index);
    for (const name of ["position", "color", "normal"]) geometry.setAttribute(name, new THREE.BufferAttribute(new Float32Array(3 * grown(vertices)), 3));
    this.replaced = new Uint32Array();
  }

  private attribute(name: "index" | "position" | "color"): THREE.BufferAttribute {
    return (name === "index" ? this.geometry.index : this.geometry.getAttribute(name)) as THREE.BufferAttribute;
  }
}
