// An arrow with a body: lines are one pixel thin whatever is asked.
import * as THREE from "three";

const UP = new THREE.Vector3(0, 1, 0);

export class Arrow extends THREE.Group {
  private readonly material = new THREE.MeshBasicMaterial({ color: 0x6fe0c2 });
  private readonly shaft: THREE.Mesh;
  private readonly head: THREE.Mesh;

  /** `width` (m) of the shaft. */
  constructor(private readonly width: number) {
    super();
    // Unit pieces that stand on the origin, along y.
    this.shaft = new THREE.Mesh(new THREE.CylinderGeometry(width / 2, width / 2, 1, 12).translate(0, 0.5, 0), this.material);
    this.head = new THREE.Mesh(new THREE.ConeGeometry(1.6 * width, 1, 20).translate(0, 0.5, 0), this.material);
    this.add(this.shaft, this.head);
  }

  /** Points along the unit vector `along`, from `from` to `length` (m) away. */
  point(from: THREE.Vector3, along: THREE.Vector3, length: number): void {
    this.position.copy(from);
    this.quaternion.setFromUnitVectors(UP, along);
    const fullHead = 4.5 * this.width;
    const head = Math.min(fullHead, length);
    this.shaft.scale.y = Math.max(length - head, 1e-9);
    // A short arrow is all head, of the same form.
    const narrow = head / fullHead;
    this.shaft.scale.x = this.shaft.scale.z = this.head.scale.x = this.head.scale.z = narrow;
    this.head.scale.y = head;
    this.head.position.y = length - head;
  }

  /** Where it ends. */
  tip(): THREE.Vector3 {
    return new THREE.Vector3(0, this.head.position.y + this.head.scale.y, 0).applyQuaternion(this.quaternion).add(this.position);
  }

  dispose(): void {
    this.shaft.geometry.dispose();
    this.head.geometry.dispose();
    this.material.dispose();
  }
}
