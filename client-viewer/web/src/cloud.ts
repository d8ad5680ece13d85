// Particles as small balls: points that are round, lit from the eye, and keep their size in metres.
import * as THREE from "three";

const VERTEX = `
  uniform float diameter;
  uniform float height;
  void main() {
    vec4 eye = modelViewMatrix * vec4(position, 1.0);
    gl_Position = projectionMatrix * eye;
    // From afar they would vanish.
    gl_PointSize = max(0.5 * height * projectionMatrix[1][1] * diameter / -eye.z, 3.0);
  }`;

const FRAGMENT = `
  uniform vec3 colour;
  void main() {
    vec2 at = 2.0 * gl_PointCoord - 1.0;
    float square = dot(at, at);
    if (square > 1.0) discard;
    gl_FragColor = vec4(colour * (0.2 + 0.8 * sqrt(1.0 - square)), 1.0);
    #include <colorspace_fragment>
  }`;

/** Diameter of a ball, in spacings: neighbours stay apart in a body that is pressed. */
const DIAMETER_SPACINGS = 0.5;

export class Cloud extends THREE.Points<THREE.BufferGeometry, THREE.ShaderMaterial> {
  private room = 0;

  constructor(colour: THREE.ColorRepresentation) {
    const uniforms = { diameter: { value: 0 }, height: { value: 1 }, colour: { value: new THREE.Color(colour) } };
    super(new THREE.BufferGeometry(), new THREE.ShaderMaterial({ vertexShader: VERTEX, fragmentShader: FRAGMENT, uniforms }));
    this.frustumCulled = false;
    const size = new THREE.Vector2();
    this.onBeforeRender = (renderer) => {
      uniforms.height.value = renderer.getDrawingBufferSize(size).height;
    };
  }

  /** Shows particles at these positions (m), `spacing` (m) apart at rest. */
  move(positions: Float32Array, spacing: number): void {
    if (positions.length > this.room) {
      this.room = 2 * positions.length;
      this.geometry.dispose();
      this.geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(this.room), 3));
    }
    const places = this.geometry.getAttribute("position") as THREE.BufferAttribute | undefined;
    places?.array.set(positions);
    if (places) places.needsUpdate = true;
    this.geometry.setDrawRange(0, positions.length / 3);
    this.material.uniforms["diameter"]!.value = DIAMETER_SPACINGS * spacing;
  }
}
