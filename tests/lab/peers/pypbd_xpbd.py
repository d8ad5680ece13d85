"""PositionBasedDynamics: XPBD on tetrahedra, each with its elastic energy as its constraint ("FEM based XPBD", solid method 3).

One iteration per step and many steps, as small-step XPBD has it: more iterations than one make this constraint, which turns its direction
as it shrinks, much too stiff (README.md has numbers).
"""

from time import perf_counter

import numpy as np
import pypbd

from exchange import Variant, serve

XPBD_FEM = 3
# The library skips constraints whose squared gradient is below an absolute 1e-6, which in metres are all, and adds a gravity of 9.81 units
# per s² that Python cannot turn off. In micrometres neither is felt.
UNITS_PER_M = 1e6


class Solid:
    def __init__(self, problem, steps):
        self.problem, self.steps, self.step_s = problem, steps, problem.tick_s / steps
        self.model = pypbd.SimulationModel()
        self.model.init()
        tets = problem.tets.flatten().tolist()
        solid = self.model.addTetModel(list(problem.rest_positions_m * UNITS_PER_M), tets)
        self.particles = self.model.getParticles()
        masses_kg = np.zeros_like(problem.masses_kg)
        masses_kg[problem.free] = problem.masses_kg[problem.free]
        for node, mass_kg in enumerate(masses_kg):
            self.particles.setMass(node, mass_kg)
        # Pa = kg/(m s²)
        young = problem.young_modulus_pa / UNITS_PER_M
        unused = (1.0, False, False)
        self.model.addSolidConstraints(solid, XPBD_FEM, young, problem.poisson_ratio, *unused)
        self.stepper = pypbd.TimeStepController()
        self.stepper.init()
        self.stepper.setValueUInt(pypbd.TimeStepController.NUM_SUB_STEPS, 1)
        self.stepper.setValueUInt(pypbd.TimeStepController.MAX_ITERATIONS, 1)
        self.stepper.setValueUInt(pypbd.TimeStepController.MAX_ITERATIONS_V, 0)
        loaded = [node for node in problem.free if problem.forces_n[node].any()]
        self.kicks = [(n, self.step_s * UNITS_PER_M * problem.forces_n[n] / problem.masses_kg[n]) for n in loaded]

    def tick(self, fraction):
        particles, elapsed_s = self.particles, 0.0
        pypbd.TimeManager.getCurrent().setTimeStepSize(self.step_s)
        for node in self.problem.free:
            particles.setVelocity(node, particles.getVelocity(node) * self.problem.decay)
        for _ in range(self.steps):
            # The library has no forces on particles: v += dt f/m, which is what its own gravity does.
            for node, kick in self.kicks:
                particles.setVelocity(node, particles.getVelocity(node) + fraction * kick)
            start = perf_counter()
            self.stepper.step(self.model)
            elapsed_s += perf_counter() - start
        return elapsed_s

    def positions_m(self):
        nodes = range(len(self.problem.masses_kg))
        return np.array([self.particles.getPosition(node) for node in nodes]) / UNITS_PER_M


def variant(steps):
    name = f"XPBD {steps} step{'s' if steps > 1 else ''}"
    settings = f"solid method 3 (FEM based XPBD), {steps} steps a tick, 1 iteration each, first-order velocity update, double precision"
    return Variant(name, settings, "St. Venant-Kirchhoff", "StVenantKirchhoff", steps, Solid)


if __name__ == "__main__":
    pypbd.Simulation.getCurrent().initDefault()
    serve("PositionBasedDynamics", [variant(steps) for steps in (1, 2, 5, 10, 20)])
