"""How a peer speaks with the lab; README.md has the format.

A script calls `serve(peer, variants)`: it reads the problem (the file named by the first argument), brings every variant to rest, answers
one line of JSON, and then times ticks whenever it is asked to, one line of JSON per request.
"""

import itertools
import json
import math
import sys
import traceback

import numpy as np

FORMAT = 1
# Ticks after which it is known whether the budget will do.
TRIAL = 10
# A body whose nodes go farther (m) than this is not the lab's any more.
FAR_M = 1.0
# Where the number of steps is looked for, answers that move by more than this fraction over the last ticks count as unstable.
RESTLESS = 1e-3
# What libraries print to standard output must not get between the lines.
OUT, sys.stdout = sys.stdout, sys.stderr


class Problem:
    """A body, what holds it, what presses it, and how fast. Fields are those of the file, nodal values as arrays."""

    def __init__(self, fields):
        if fields["format"] != FORMAT:
            raise ValueError(f"the lab writes format {fields['format']}, this script reads {FORMAT}")
        self.__dict__.update(fields)
        self.rest_positions_m = np.array(self.rest_positions_m)
        self.tets = np.array(self.tets, dtype=np.int32)
        self.masses_kg = np.array(self.masses_kg)
        self.forces_n = np.zeros_like(self.rest_positions_m)
        for node, force_n in self.nodal_forces_n:
            self.forces_n[node] += force_n
        # Velocities fall by this once a tick, untimed: damping has no say in the answer at rest.
        self.decay = math.exp(-self.damping_per_s * self.tick_s)
        held = set(self.held_nodes)
        self.free = np.array([node for node in range(len(self.masses_kg)) if node not in held])

    def answer_m(self, displacements_m):
        """The displacement conjugate to the load: its work over its sum."""
        return float((self.forces_n * displacements_m).sum() / self.force_sum_n)


class Variant:
    """One way to run a peer. `tick(fraction)` goes through 1 ms under this fraction of the load and returns the time (s) that the peer's
    own code took; `positions_m()` gives all nodes. `law` is for people, `obeys` one of the lab's names of laws."""

    def __init__(self, name, settings, law, obeys, steps_per_tick, build):
        self.name, self.settings, self.law, self.obeys = name, settings, law, obeys
        self.steps_per_tick, self.build, self.running = steps_per_tick, build, None

    def settle(self, problem):
        """Ramp and rest: the row that the lab reads."""
        row = {
            "name": self.name,
            "settings": self.settings,
            "law": self.law,
            "same_law": self.obeys == problem.law,
            "answers_m": [],
            "displacements_m": [],
            "failure": "",
        }
        try:
            self.running, self.steps_per_tick = self.at_rest(problem, row)
        except Exception as error:  # one variant's failure is its own
            traceback.print_exc()
            row["failure"] = str(error) or type(error).__name__
        return row | {"steps_per_tick": self.steps_per_tick if isinstance(self.steps_per_tick, int) else 0}

    def at_rest(self, problem, row):
        """With the given steps per tick, or the first of a list that stays stable."""
        if isinstance(self.steps_per_tick, int):
            running = self.build(problem, self.steps_per_tick)
            row |= settle(problem, running)
            return running, self.steps_per_tick
        for steps in self.steps_per_tick:
            try:
                running = self.build(problem, steps)
                row |= at_rest_or_unstable(settle(problem, running))
                return running, steps
            except Unstable as error:
                unstable = error
        raise unstable


class Unstable(Exception):
    """Not finite, or far away."""


def settle(problem, running):
    """Goes through ramp and rest: answers of the last ticks, displacements at the end."""
    answers_m, fastest_s, ticks = [], math.inf, len(problem.fractions)
    for tick, fraction in enumerate(problem.fractions, 1):
        fastest_s = min(fastest_s, running.tick(fraction))
        projected_s = fastest_s * ticks
        if tick == TRIAL and projected_s > problem.budget_s:
            raise RuntimeError(f"would take {projected_s:.1f} s to come to rest; {problem.budget_s} s are allowed")
        last = tick + problem.last_ticks > ticks
        if last or tick % TRIAL == 0:
            displacements_m = running.positions_m() - problem.rest_positions_m
            if not np.abs(displacements_m).max() < FAR_M:
                raise Unstable(f"became unstable within {tick} ticks")
        if last:
            answers_m.append(problem.answer_m(displacements_m))
    return {"answers_m": answers_m, "displacements_m": displacements_m.tolist()}


def at_rest_or_unstable(settled):
    answers_m = settled["answers_m"]
    spread_m = max(answers_m) - min(answers_m)
    if spread_m > RESTLESS * abs(answers_m[-1]):
        raise Unstable(f"does not come to rest: the answer still moves by {spread_m:.1e} m")
    return settled


def serve(peer, variants):
    """Settles all variants, then answers `time ROUNDS SECONDS` with times (s) of ticks: at most so many, and no longer, for each."""
    with open(sys.argv[1], encoding="utf-8") as file:
        problem = Problem(json.load(file))
    answer({"format": FORMAT, "peer": peer, "rows": [variant.settle(problem) for variant in variants]})
    # Each goes on where it was: some take fewer turns than others.
    contenders = [(variant.running, itertools.cycle(problem.timed_fractions)) for variant in variants]
    for line in sys.stdin:
        _, rounds, seconds = line.split()
        answer({"times_s": take_turns(contenders, int(rounds), float(seconds))})


def take_turns(contenders, rounds, seconds):
    times_s = [[] for _ in contenders]
    for _ in range(rounds):
        for (running, fractions), times in zip(contenders, times_s):
            if running is not None and 2 * sum(times) < seconds:
                # Untimed: fetches back what the others pushed out of the caches.
                running.tick(next(fractions))
                times.append(running.tick(next(fractions)))
    return times_s


def answer(value):
    OUT.write(json.dumps(value) + "\n")
    OUT.flush()
