"""MuJoCo's flex: linear tetrahedra whose nodes are bodies on three sliders.

With the integrator `discrete` elasticity is implicit and a step of 1 ms is stable; with `Euler` it is explicit, and as many steps are
taken as stay stable. The elastic forces of a flex are StVK's; stable neo-Hookean ones (`elastic3d = 1`, experimental) need `discrete`.
"""

from time import perf_counter

import mujoco
import numpy as np

from exchange import Variant, serve

STVK, SNH = 0, 1
EULER_STEPS = (2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 16, 20, 24, 28, 32, 40, 48, 64)


class Flex:
    def __init__(self, problem, law, integrator, solver, steps):
        self.problem, self.steps = problem, steps
        spec = mujoco.MjSpec()
        spec.option.timestep = problem.tick_s / steps
        spec.option.integrator, spec.option.solver = integrator, solver
        spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_GRAVITY
        bodies, vertices_m = ["world"] * len(problem.masses_kg), problem.rest_positions_m.copy()
        for node in problem.free:
            body = spec.worldbody.add_body(name=f"n{node}", pos=problem.rest_positions_m[node])
            # The inertia means nothing on sliders, but must be given.
            body.mass, body.inertia, body.explicitinertial = problem.masses_kg[node], [1e-9] * 3, True
            for axis in np.eye(3):
                body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
            bodies[node], vertices_m[node] = body.name, 0.0
        flex = spec.add_flex(name="body", dim=3, radius=1e-5)
        flex.vertbody, flex.vert, flex.elem = bodies, vertices_m.flatten(), problem.tets.flatten()
        flex.young, flex.poisson, flex.elastic3d = problem.young_modulus_pa, problem.poisson_ratio, law
        flex.contype, flex.conaffinity, flex.selfcollide = 0, 0, mujoco.mjtFlexSelf.mjFLEXSELF_NONE
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.full_load_n = problem.forces_n[problem.free].flatten()

    def tick(self, fraction):
        self.data.qvel *= self.problem.decay
        self.data.qfrc_applied[:] = fraction * self.full_load_n
        start = perf_counter()
        mujoco.mj_step(self.model, self.data, self.steps)
        return perf_counter() - start

    def positions_m(self):
        x = self.problem.rest_positions_m.copy()
        x[self.problem.free] += self.data.qpos.reshape(-1, 3)
        return x


def variant(short, law, integrator, solver, steps, settings):
    def build(problem, steps):
        integrators, solvers = mujoco.mjtIntegrator.__members__, mujoco.mjtSolver.__members__
        return Flex(problem, law, integrators[f"mjINT_{integrator.upper()}"], solvers[f"mjSOL_{solver.upper()}"], steps)

    words = ("St. Venant-Kirchhoff", "simplified stable neo-Hookean")[law]
    obeys = ("StVenantKirchhoff", "StableNeoHookean")[law]
    settings = f"dof full, integrator {integrator}, solver {solver} (tolerance 1e-8, 100 iterations), {settings}; no contact, no gravity"
    return Variant(short, settings, words, obeys, steps, build)


def variants():
    yield variant("neo-Hookean implicit (Newton)", SNH, "discrete", "Newton", 1, "timestep 1 ms")
    yield variant("neo-Hookean implicit (CG)", SNH, "discrete", "CG", 1, "timestep 1 ms")
    yield variant("StVK implicit (Newton)", STVK, "discrete", "Newton", 1, "timestep 1 ms")
    yield variant("StVK implicit (CG)", STVK, "discrete", "CG", 1, "timestep 1 ms")
    yield variant("StVK explicit", STVK, "Euler", "Newton", EULER_STEPS, "the fewest steps per tick that stay stable")


if __name__ == "__main__":
    serve("MuJoCo flex", list(variants()))
