// The three-dimensional view: surface, rest shape, tools and force arrows.
import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { Arrow } from "./arrow";
import { Cloud } from "./cloud";
import type { Patch } from "./refined";
import { Skin } from "./skin";
import type { Surface } from "./surface";
import type { Quaternion, ToolState, Vec3 } from "./wire";

const vector = (v: Vec3 | undefined) => new THREE.Vector3(v?.x ?? 0, v?.y ?? 0, v?.z ?? 0);
const rotation = (q: Quaternion | undefined) => new THREE.Quaternion(q?.x ?? 0, q?.y ?? 0, q?.z ?? 0, q?.w ?? 1);

/** Length of the longest arrow, in sizes of the body. */
const LONGEST_ARROW = 0.25;

/** Of the surface while what is in it shall be seen. */
const TRANSLUCENT = 0.3;

/** Three circles around the origin, one in each plane; of a capsule along z, its outline in two of them and a circle at either end. */
function rings(radius: number, half: number): THREE.BufferGeometry {
  const points: number[] = [];
  for (const [axis, side] of [[0, 1], [1, 1], [2, 1], [2, -1]] as const) {
    for (let i = 0; i < 128; i++) {
      // Both ends of each of 64 segments.
      const angle = (2 * Math.PI * Math.ceil(i / 2)) / 64;
      const at = [0, 0, 0];
      at[(axis + 1) % 3] = radius * Math.cos(angle);
      at[(axis + 2) % 3] = radius * Math.sin(angle);
      at[2] = at[2]! + half * (axis === 2 ? side : at[2]! < 0 ? -1 : 1);
      points.push(...at);
    }
  }
  return new THREE.BufferGeometry().setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
}

/** A rectangle of the window (CSS pixels). */
export interface Extent { left: number; top: number; right: number; bottom: number }

/** Of the smaller direction of the view. */
const FIELD_OF_VIEW_DEG = 35;

function corners({ min, max }: THREE.Box3): THREE.Vector3[] {
  return [min.x, max.x].flatMap((x) => [min.y, max.y].flatMap((y) => [min.z, max.z].map((z) => new THREE.Vector3(x, y, z))));
}

interface ToolView { radiusM: number; halfLengthM: number; proxy: THREE.Mesh; device: THREE.LineSegments; arrow: Arrow }

export class Stage {
  private readonly renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true });
  private readonly scene = new THREE.Scene();
  private readonly camera = new THREE.PerspectiveCamera(FIELD_OF_VIEW_DEG, 1, 0.001, 10);
  private readonly controls: OrbitControls;
  private readonly body = new THREE.Group();
  private readonly material = new THREE.MeshStandardMaterial({
    vertexColors: true, roughness: 0.55, metalness: 0, side: THREE.DoubleSide,
  });
  private readonly edges = new THREE.MeshBasicMaterial({ color: 0x0d1013, wireframe: true, transparent: true, opacity: 0.35 });
  private readonly ghost = new THREE.MeshBasicMaterial({ color: 0x9aa4ad, wireframe: true, transparent: true, opacity: 0.3 });
  private skin: Skin | undefined;
  private surface: Surface | undefined;
  private ghostMesh: THREE.Mesh | undefined;
  private edgeMesh: THREE.Mesh | undefined;
  private readonly particles = new Cloud(0xd4f23c);
  private tools: ToolView[] = [];
  private size = 0.05;
  private dirty = true;

  constructor(private readonly host: HTMLElement) {
    const sky = new THREE.HemisphereLight(0xf4f6f8, 0x6b5f55, 1.5);
    sky.position.set(0, 0, 1);
    this.scene.add(sky);
    const sun = new THREE.DirectionalLight(0xffffff, 2.0);
    sun.position.set(-0.5, 0.7, 1);
    // The lamp moves with the eye, so that a dent is shaded from wherever one looks.
    this.camera.add(sun);
    this.particles.visible = false;
    this.scene.add(this.camera, this.body, this.particles);
    this.renderer.domElement.addEventListener("webglcontextrestored", () => (this.dirty = true));
    host.append(this.renderer.domElement);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, this.renderer.domElement);
    this.controls.enableDamping = true;
    this.controls.addEventListener("change", () => (this.dirty = true));
    new ResizeObserver(() => this.resize()).observe(host);
    this.resize();
  }

  /** Shows another surface; looks at its middle unless it is the same session's, seen as the user left it. */
  show(surface: Surface): void {
    const known = this.surface?.header.sessionId === surface.header.sessionId;
    this.body.clear();
    this.skin?.geometry.dispose();
    this.ghostMesh?.geometry.dispose();
    this.surface = surface;
    this.skin = new Skin(surface);
    const { geometry } = this.skin;
    const rest = new THREE.BufferGeometry();
    rest.setIndex(new THREE.BufferAttribute(surface.triangles, 1));
    rest.setAttribute("position", new THREE.BufferAttribute(surface.rest, 3));
    const body = new THREE.Mesh(geometry, this.material);
    body.frustumCulled = false;
    this.edgeMesh = new THREE.Mesh(geometry, this.edges);
    this.edgeMesh.frustumCulled = false;
    this.ghostMesh = new THREE.Mesh(rest, this.ghost);
    this.body.add(body, this.edgeMesh, this.ghostMesh);
    this.setEdges(this.edges.visible);
    this.setGhost(this.ghost.visible);
    this.size = Math.max(vector(surface.header.boundsMaxM).distanceTo(vector(surface.header.boundsMinM)), 1e-4);
    this.makeTools(surface);
    if (!known) this.recentre();
  }

  setEdges(on: boolean): void {
    this.edges.visible = on;
    this.dirty = true;
  }

  setGhost(on: boolean): void {
    this.ghost.visible = on;
    this.dirty = true;
  }

  /** Draws active particles, and the surface so that they are seen through it. */
  setParticles(on: boolean): void {
    if (this.particles.visible === on) return;
    this.particles.visible = on;
    this.particles.move(new Float32Array(), 0);
    this.material.transparent = on;
    this.material.opacity = on ? TRANSLUCENT : 1;
    this.material.depthWrite = !on;
    this.material.needsUpdate = true;
    this.dirty = true;
  }

  /** Takes over positions (m) of active particles, `spacing` (m) apart at rest. */
  moveParticles(positions: Float32Array, spacing: number): void {
    this.particles.move(positions, spacing);
    this.dirty = true;
  }

  recentre(): void {
    const low = vector(this.surface?.header.boundsMinM);
    const high = vector(this.surface?.header.boundsMaxM);
    const centre = low.clone().add(high).multiplyScalar(0.5);
    // The sphere around the body's box fits whichever way one turns, with some room for a tool beside it.
    const distance = (0.55 * this.size) / Math.sin(THREE.MathUtils.degToRad(FIELD_OF_VIEW_DEG / 2));
    this.camera.near = this.size / 100;
    this.camera.far = this.size * 40;
    this.controls.minDistance = this.size / 10;
    this.controls.maxDistance = this.size * 20;
    this.camera.position.copy(centre).add(new THREE.Vector3(0.75, -1.35, 0.55).normalize().multiplyScalar(distance));
    this.camera.updateProjectionMatrix();
    this.controls.target.copy(centre);
    this.dirty = true;
  }

  /** What is drawn refined from the next refresh on; nothing: the surface as it is. */
  setPatch(patch: Patch | undefined): void {
    if (this.skin) this.skin.patch = patch;
  }

  /** Takes over changed positions and colours; `top` is the displacement (m) of the last colour. */
  refresh(top: number): void {
    this.skin?.refresh(top);
    this.dirty = true;
  }

  moveTools(states: ToolState[], fullScaleN: number): void {
    this.tools.forEach((view, index) => {
      const state = states[index];
      view.proxy.visible = view.device.visible = view.arrow.visible = state !== undefined;
      if (!state) return;
      view.proxy.position.copy(vector(state.proxyPositionM));
      view.device.position.copy(vector(state.devicePositionM));
      if (view.halfLengthM > 0) {
        view.proxy.quaternion.copy(rotation(state.proxyOrientation));
        view.device.quaternion.copy(rotation(state.deviceOrientation));
      }
      const force = vector(state.contactForceN);
      const length = force.length();
      view.arrow.visible = length > 1e-6;
      if (!view.arrow.visible) return;
      force.normalize();
      // From the ball's surface: a small arrow would be inside.
      const from = view.proxy.position.clone().addScaledVector(force, view.radiusM);
      view.arrow.point(from, force, this.size * LONGEST_ARROW * Math.min(length / fullScaleN, 1));
    });
    this.dirty = true;
  }

  /** Where the window shows the body's box at rest, and the tools with their arrows. */
  extent(): { body: Extent; tools: Extent } {
    this.camera.updateMatrixWorld();
    const box = new THREE.Box3(vector(this.surface?.header.boundsMinM), vector(this.surface?.header.boundsMaxM));
    const tools = this.tools.filter((view) => view.proxy.visible).flatMap((view) => {
      // The ends of each ball across and up the window: a capsule has one at either end.
      const balls = [view.proxy, view.device].flatMap((solid) => [-1, 1].map((end) =>
        new THREE.Vector3(0, 0, end * view.halfLengthM).applyQuaternion(solid.quaternion).add(solid.position)));
      const ends = balls.flatMap((ball) => [0, 1].flatMap((axis) => [-1, 1].map((sign) =>
        new THREE.Vector3().setFromMatrixColumn(this.camera.matrixWorld, axis).multiplyScalar(sign * view.radiusM).add(ball))));
      return [...ends, ...(view.arrow.visible ? [view.arrow.tip()] : [])];
    });
    return { body: this.onScreen(corners(box)), tools: this.onScreen(tools) };
  }

  /** Geometries that the graphics card holds: constant however many surfaces were shown. */
  get geometries(): number {
    return this.renderer.info.memory.geometries;
  }

  render(): void {
    this.controls.update();
    if (!this.dirty) return;
    this.dirty = false;
    this.renderer.render(this.scene, this.camera);
  }

  private onScreen(points: THREE.Vector3[]): Extent {
    const view = this.renderer.domElement.getBoundingClientRect();
    const xs: number[] = [];
    const ys: number[] = [];
    for (const point of points) {
      const { x, y } = point.clone().project(this.camera);
      xs.push(view.left + (view.width * (1 + x)) / 2);
      ys.push(view.top + (view.height * (1 - y)) / 2);
    }
    return { left: Math.min(...xs), top: Math.min(...ys), right: Math.max(...xs), bottom: Math.max(...ys) };
  }

  private makeTools(surface: Surface): void {
    for (const view of this.tools) {
      this.scene.remove(view.proxy, view.device, view.arrow);
      view.proxy.geometry.dispose();
      view.device.geometry.dispose();
      for (const drawn of [view.proxy, view.device]) (drawn.material as THREE.Material).dispose();
      view.arrow.dispose();
    }
    this.tools = surface.header.tools.map((tool) => {
      const solid = tool.halfLengthM > 0
        // Along y as it is made.
        ? new THREE.CapsuleGeometry(tool.radiusM, 2 * tool.halfLengthM, 12, 48).rotateX(Math.PI / 2)
        : new THREE.SphereGeometry(tool.radiusM, 48, 24);
      const proxy = new THREE.Mesh(solid, new THREE.MeshStandardMaterial({ color: 0xe9e4da, roughness: 0.35, transparent: true, opacity: 0.85 }));
      // Seen through the body: there it is while the arm presses.
      const device = new THREE.LineSegments(rings(tool.radiusM, tool.halfLengthM), new THREE.LineBasicMaterial({ color: 0x6fb7e9, depthTest: false, transparent: true }));
      device.renderOrder = 1;
      const arrow = new Arrow(0.012 * this.size);
      // Nobody knows yet where they are.
      proxy.visible = device.visible = arrow.visible = false;
      this.scene.add(proxy, device, arrow);
      return { radiusM: tool.radiusM, halfLengthM: tool.halfLengthM, proxy, device, arrow };
    });
  }

  private resize(): void {
    const { clientWidth, clientHeight } = this.host;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.setSize(clientWidth, clientHeight);
    this.camera.aspect = Math.max(clientWidth, 1) / Math.max(clientHeight, 1);
    // The same view in the smaller direction, so that the whole body is seen in a window that is higher than wide.
    const half = Math.tan(THREE.MathUtils.degToRad(FIELD_OF_VIEW_DEG / 2)) / Math.min(this.camera.aspect, 1);
    this.camera.fov = 2 * THREE.MathUtils.radToDeg(Math.atan(half));
    this.camera.updateProjectionMatrix();
    this.dirty = true;
  }
}
