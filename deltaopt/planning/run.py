"""One run of the planner: attempts from first motions, in one loop, until a plan is good enough.

What is attempted depends on the kind of scene alone; how attempts are made, remedied and told does
not.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial, reduce
from itertools import chain, islice
from math import inf, isfinite
from operator import attrgetter
from time import perf_counter

from deltaopt.curves.piecewise import PiecewisePolynomial
from deltaopt.errors import (
    ENDS_AN_ATTEMPT,
    NO_PLAN,
    DeltaOptError,
    NotConverged,
    if_possible,
)
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.attempts import (
    Attempt,
    Outcomes,
    Search,
    from_motion,
    what_came_of,
)
from deltaopt.planning.belt_places import PlacesOnBelt, TooLate
from deltaopt.planning.effort_planning import require_possible
from deltaopt.planning.few_points import FewPoints, any_overlap
from deltaopt.planning.first_motions.around_bodies import CLEAR, is_clear, name_of_way
from deltaopt.planning.first_motions.bands import without_bodies
from deltaopt.planning.first_motions.initial_motion import Proposal
from deltaopt.planning.first_motions.multistart import other_motions
from deltaopt.planning.first_motions.order_of_merit import first_motion
from deltaopt.planning.first_motions.passages import paths_of_lines
from deltaopt.planning.first_motions.through_gates import simple_motions, through_gates
from deltaopt.planning.formulations.choice import Flat
from deltaopt.planning.in_flight import finished_first, nearly_over, stop_of
from deltaopt.planning.links_clear import keeping_links_clear
from deltaopt.planning.loop import NEAR_BEST, USUAL, Loop, Outcome, better, or_error, or_raise
from deltaopt.planning.past_bodies.legs import Legs, proposed_in_legs, ways_in_legs
from deltaopt.planning.past_bodies.ways import NEARLY, at_rest, fastest_way, ways_past
from deltaopt.planning.path.path_planning import (
    OF_ROOM,
    fastest_along,
    near_corners,
    planned_on_path,
)
from deltaopt.planning.plan import Plan, TakenWay, quicker, resolvable
from deltaopt.scene.feasibility import check_feasible
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.objective import Time
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import OnPath, given_points

_PATHS = 2
"""How many paths of straight lines are planned along where no mesh finds its way: over few places,
and over more of them. Each takes a second or two."""
_MISSED = 3e-3
"""Gap of a way past bodies above which the paths of straight lines are looked at too, where it also
misses the tolerance: through a window of 3 mm one with 7e-3 was longer by 2 %."""
_SLOWER = (1.5, 1.0)
"""By what factors legs past bodies are slowed, one after the other."""


@dataclass(frozen=True)
class Run(Loop):
    """Plans one scene."""

    def plan(
        self,
        scene: Scene,
        under_way: PiecewisePolynomial | None,
        search: Search | None,
    ) -> Plan:
        """The best plan of a scene.

        ``under_way``: what would follow the start, if that is known. ``search``: for better plans
        than the usual one. Raises what rules a plan out, and NotConverged.
        """
        check_feasible(scene)

        def usual(scene: Scene) -> Plan:
            is_time = isinstance(scene.objective, Time)
            found = None if is_time else self._at_least_cost(scene, under_way)
            return found or self._plan_by_limits(scene, under_way)

        if search is None:
            found = self._links_clear(scene, usual)
        else:
            found = self._best_of_others(scene, usual, search)
        if found.gap == inf and isinstance(scene.objective, Time) and found.lower_bound:
            found = replace(found, gap=found.duration / found.lower_bound - 1)
        return found

    def plan_near(self, scene: Scene, motion: Trajectory) -> Plan:
        """The plan that a motion near the best leads to, such as that of another objective. Raises
        what rules a plan out, and NotConverged where it leads to none near an optimum."""
        check_feasible(scene)

        def nearby(scene: Scene) -> Plan:
            found = self.nearby(scene, motion)
            if found is None:
                raise NotConverged("that motion is near no optimum", "Not_Near", motion)
            return found

        return self._links_clear(scene, nearby)

    def _links_clear(self, scene: Scene, planned: Callable[[Scene], Plan]) -> Plan:
        """The plan of a scene by its limits, with arms and forearms clear of bodies if asked."""
        if not scene.keeps_links_clear:
            return planned(scene)
        return replace(keeping_links_clear(self, scene, planned), scene=scene)

    def _best_of_others(self, scene: Scene, usual: Callable[[Scene], Plan], search: Search) -> Plan:
        """The best of the ``usual`` plan and of those from other first motions, with what was
        looked at. Raises the first error if none leads to a plan."""
        so_far = Outcomes(scene, self.good_gap(scene))
        first = or_error(self._links_clear, scene, usual)
        so_far.add(first)
        known = first if isinstance(first, Plan) else None
        if known and scene.objective.is_share:  # others take as long, not a share of their own
            in_time = scene.objective.alone(known.duration)
            scene = scene.model_copy(update={"objective": in_time})
        motion, begin = known.trajectory if known else None, perf_counter()
        for number, other in enumerate(other_motions(scene, motion, search.most, search.seed), 2):
            attempt = from_motion(
                scene, Proposal(f"start {number}", other), self.optimiser.intervals
            )
            clear_from = partial(self._clear_from, attempt)
            so_far.add(or_error(self._links_clear, scene, clear_from))
            if perf_counter() - begin > search.seconds:
                break
        best, led = so_far.best_known(), len(so_far.plans) - bool(known)
        searched = what_came_of(so_far.tried - 1, led, best, known)
        ways = best.ways or (known.ways if known else ())
        return replace(best, searched=searched, ways=ways)

    def _clear_from(self, attempt: Attempt, scene: Scene) -> Plan:
        """The plan from a first motion alone, past all bodies of a scene."""
        found = self.only_from(replace(attempt, scene=scene))
        if not is_clear(scene, found.trajectory):
            raise NotConverged("it runs into a body", "Not_Clear", found.trajectory)
        return found

    def _at_once(self, scene: Scene, under_way: PiecewisePolynomial | None) -> Plan:
        """The plan in phases or where an end moves from the best first motion alone."""
        first = next(simple_motions(scene, under_way), None)
        if first is None:
            raise NotConverged("no simple motion stays within reach", "No_Start", None)
        return self._clear_from(from_motion(scene, first, self.optimiser.intervals), scene)

    def _at_least_cost(self, scene: Scene, under_way: PiecewisePolynomial | None) -> Plan | None:
        """Plan for another objective than time past bodies or where spheres of via points overlap,
        or in a share of the fastest motion's duration: from the usual first motions, and where
        these lead to no plan, or in the first two cases to none near an optimum, from the fastest
        motion of all, near which the best is; in these cases a share at once, for other fastest
        motions may be slower. None of other scenes."""
        has_ways = limits_of(scene).constraints.has_convex or any_overlap(scene)
        if not (has_ways or scene.objective.is_share):
            return None
        usual: Outcome | None = None
        if not (has_ways and scene.objective.is_share):
            usual = or_error(self._plan_by_limits, scene, under_way)
            if isinstance(usual, Plan) and (usual.gap <= NEAR_BEST or not has_ways):
                return usual
        tolerance = max(self.optimiser.tolerance, USUAL)
        quick = replace(self, optimiser=replace(self.optimiser, tolerance=tolerance))
        fastest = quick._plan_by_limits(scene.model_copy(update={"objective": Time()}), under_way)
        objective = scene.objective.after(fastest.duration)
        if objective.given_duration is not None:
            require_possible(objective.given_duration, fastest.duration, fastest.gap)
        asked = scene.model_copy(update={"objective": objective})
        found = self.nearby(asked, fastest.trajectory)
        if found is not None:
            found = self.improved(asked, found)
        elif usual is None:
            found = self._plan_by_limits(asked, under_way)
        else:  # once more the usual first motions would lead to as much
            known: Outcome = usual
            found = self.at_worst(asked, lambda _: or_raise(known))
        return replace(found, scene=scene, ways=found.ways or fastest.ways)

    def _plan_by_limits(self, scene: Scene, under_way: PiecewisePolynomial | None) -> Plan:
        """Plan a scene that is feasible, of arms and forearms with those alone clear of bodies that
        are planned to be."""
        task = scene.task
        if isinstance(task, OnPath):
            return planned_on_path(scene, self.optimiser.tolerance, self.journal.mesh)
        if task.moves_at_ends or task.gates:
            later = under_way if task.moves_at_ends else None
            planned = partial(self._plan_moving, under_way=later)
            through_all = partial(self.at_worst, planned=planned)
            if not any_overlap(scene):
                return resolvable(through_all(scene))
            at_once = partial(self._at_once, under_way=later)
            found = FewPoints(through_all, at_once, self.journal.note).plan(scene)
            if isinstance(scene.objective, Time):  # that of fewer points need not be finished first
                then = partial(self._plan_by_limits, under_way=None)
                found = finished_first(self, scene, then, later, found) or found
            return resolvable(found)
        past_bodies = limits_of(scene).constraints.has_convex
        return self.at_worst(scene, self._past_bodies if past_bodies else self.by_merit)

    def _past_or_through(self, scene: Scene, proposals: Iterator[Proposal]) -> Plan | DeltaOptError:
        """From first motions in phases or where an end moves, and from legs that are planned from
        rest to rest: these come first where bodies are in the way of the others."""
        first = next(proposals, None)
        legs = chain.from_iterable(proposed_in_legs(scene, self._legs, each) for each in _SLOWER)
        if first is None or not is_clear(scene, first.motion):
            proposals = chain(legs, [first] if first else [], proposals)
        else:
            proposals = chain([first], proposals, legs)
        found = self.until_good(scene, proposals)
        if isinstance(found, Plan):
            return self.improved(scene, found)
        task, refused = scene.task, self._legs.refused.items()
        given = {each.position for each in (task.start, *task.via, task.goal) if not each.within}
        # Of places that the planner chose, as where a stop ends, others may do.
        return next((why for leg, why in refused if given >= {*given_points(leg.task)}), found)

    @cached_property
    def _legs(self) -> Legs:
        """The plans of legs."""
        rough = replace(self, optimiser=replace(self.optimiser, tolerance=NEARLY))

        def planned(scene: Scene) -> Plan:
            if scene.task.is_at_rest:
                return rough._plan_by_limits(scene, None)
            found = rough.until_good(scene, simple_motions(scene))
            if isinstance(found, Plan) and is_clear(scene, found.trajectory):
                return found
            raise NotConverged("no stop or run-up that is clear of all bodies", "No_Leg", None)

        return Legs(planned, self.journal.note)

    def _plan_moving(self, scene: Scene, under_way: PiecewisePolynomial | None) -> Plan:
        """Plan the fastest motion in phases or where an end moves, from the first good guess; onto
        a belt that is not possible to meet at once, as soon as it is, if that can be."""
        if (over := nearly_over(self, scene, under_way)) is not None:
            return over
        planned = partial(self._plan_by_limits, under_way=None)
        on_belt = PlacesOnBelt(scene, partial(or_error, planned), self.to_a_place)
        if on_belt.is_awaited and (waited := on_belt.plan()):
            return waited
        found = self._moving_past(scene, under_way) or self._past_or_through(
            scene, simple_motions(scene, under_way)
        )
        found = self._onto_belt(scene, found)
        most = found.duration if isinstance(found, Plan) else inf
        if on_belt.is_met_again(most) and (waited := on_belt.plan(most)):
            found = better(found, waited)
        if isinstance(scene.objective, Time):
            first = partial(finished_first, self, scene, planned)
            is_poor = isinstance(found, Plan) and found.gap > NEAR_BEST
            if is_poor or isinstance(found, NotConverged):  # else none is known even at rest
                stopped = first(stop_of(scene, planned), None)
                found = better(found, self.improved(scene, stopped)) if stopped else found
            found = first(under_way, found if isinstance(found, Plan) else None) or found
        return or_raise(found)

    def _onto_belt(self, scene: Scene, found: Plan | DeltaOptError) -> Plan | DeltaOptError:
        """What was ``found``, if it is good enough or there is no goal on a belt; otherwise the
        better of it and a plan by way of places that the belt passes. Past bodies and through
        points, where that takes long, only if nothing near an optimum was found."""
        slow = limits_of(scene).constraints.has_convex or bool(scene.task.gates)
        enough = NEAR_BEST if slow else self.good_gap(scene)
        if not scene.task.goal.moves or (isinstance(found, Plan) and found.gap <= enough):
            return found
        tried = len(self.attempts)
        places = PlacesOnBelt(
            scene, lambda each: self._past_or_through(each, simple_motions(each)), self.to_a_place
        )
        self.journal.note("once more, by way of places that the belt passes:")
        waiting = places.plan()
        first = places.without_waiting(places.early) if places.early else waiting
        name = f"{'waiting, then ' if waiting else ''}to a place on the belt"
        there = [Proposal(name, first.trajectory, 1)] if first else []
        other = self.until_good(scene, iter(there))
        plans = [each for each in (found, other, waiting) if isinstance(each, Plan)]
        if plans or isinstance(found, Plan):  # which is among them
            return reduce(quicker, plans)
        return places.told(tried, found)

    # Past bodies

    def _past_bodies(self, scene: Scene, under_way: PiecewisePolynomial | None = None) -> Plan:
        """Plan past keep-out bodies: as if there were none, where that motion is clear of all;
        otherwise the best plan of the ways that are found, with all of these.

        Raises Infeasible where no way is found, and NotConverged.
        """
        motion: Trajectory | None = None
        try:
            free = self._in_the_open(without_bodies(scene), under_way)
            motion = free.trajectory
            if is_clear(scene, motion):
                taken = TakenWay(CLEAR, free.duration, True, motion)
                return replace(free, scene=scene, ways=(taken,))
            self.journal.note("that motion runs into bodies; ways past them:")
        except ENDS_AN_ATTEMPT as error:
            self.journal.note(str(error))
        if scene.tube is not None:  # straight lines leave it; its axis tells what is in the way
            return if_possible(NO_PLAN, self._fastest_way, scene, motion) or self.by_merit(scene)
        found, failure = list[Plan](), None
        try:
            found.append(self._fastest_way(scene, motion))
        except ENDS_AN_ATTEMPT as error:
            failure = error
        if not found or found[0].gap > max(self.optimiser.tolerance, _MISSED):
            found += self._through_passages(scene)
        if failure and not found:
            raise failure
        return min(found, key=attrgetter("cost"))

    def _fastest_way(self, scene: Scene, free: Trajectory | None) -> Plan:
        """The best plan of the ways past bodies. ``free``: the fastest motion without them, if it
        is known. Raises Infeasible where there is no way, and what ends an attempt."""
        way, sources = self._ways(scene, free)
        plan, ways = fastest_way(self, way, sources, free)
        return replace(self.improved(scene, plan), scene=scene, ways=ways)

    def _ways(
        self, scene: Scene, free: Trajectory | None
    ) -> tuple[Attempt, Iterator[list[Proposal]]]:
        """What ways past bodies are looked at from, and the ways, those of one source after the
        other. ``free``: the fastest motion without bodies, if that is known."""
        if scene.task.gates:
            ways = [each for each in through_gates(scene) if is_clear(scene, each.motion)]
            ways += ways_in_legs(scene, self._legs)
            if not ways:
                raise NotConverged("no simple motion leads past the bodies", "No_Start", free)
            intervals = self.optimiser.intervals * (1 + len(scene.task.gates))
            return Attempt(scene, ways[0].motion, intervals), iter([ways])
        # Past bodies a belt is met later than without them, so elsewhere.
        ends = None if scene.task.goal.moves else free
        way = Attempt(scene, first_motion(at_rest(scene, ends)), self.optimiser.intervals)
        return way, ways_past(way, free)

    def _moving_past(self, scene: Scene, under_way: PiecewisePolynomial | None) -> Plan | None:
        """The plan past bodies in phases or where an end moves; None without bodies, and where
        there is none. Raises TooLate for a belt that is not met without bodies either."""
        if not limits_of(scene).constraints.has_convex:
            return None
        try:
            return self._past_bodies(scene, under_way)
        except TooLate:
            raise
        except NO_PLAN as error:  # other first motions may lead to a plan
            self.journal.note(str(error))
            return None

    def _in_the_open(self, scene: Scene, under_way: PiecewisePolynomial | None) -> Plan:
        """The plan of a scene without bodies. Raises what rules it out."""
        if scene.task.is_at_rest and not scene.task.gates:
            return self.by_merit(scene)
        found = self.until_good(scene, simple_motions(scene, under_way))
        return or_raise(self._onto_belt(scene, found))

    def _through_passages(self, scene: Scene) -> list[Plan]:
        """The plan along short paths of straight lines past bodies, where no mesh finds its way:
        near their corners, or on a path itself. None where there is no motion along them.

        Through a passage of a few millimetres a solution on a mesh may lead through a wall between
        two of its points, and never come back. Where that is so from the best motion along these
        lines too, it is not known how much faster another one is: the gap is infinite.
        """
        is_flat = isinstance(self.optimiser.problem_formulation, Flat)
        in_one = scene.task.is_at_rest and not (scene.task.gates or scene.planned_links)
        usual, found = is_flat and in_one and isinstance(scene.objective, Time), list[Plan]()
        for corners in islice(paths_of_lines(scene), _PATHS) if usual else ():
            self.journal.note("near the corners of a path of straight lines:")
            for of_room in OF_ROOM if len(corners) > 2 else ():
                gates = near_corners(scene, corners, of_room)
                through = if_possible(NO_PLAN, self.until_good, gates, through_gates(gates))
                if isinstance(through, Plan) and is_clear(scene, through.trajectory):
                    found.append(through)
            timed = fastest_along(scene, corners, self.optimiser.tolerance)
            if timed is not None and not scene.has_rates:
                self.journal.note(f"on that path: {timed.duration:.6g} s")
                found.append(timed)
        if not found:
            return found
        found = [
            replace(each, scene=scene, gap=inf, certificate=None, multipliers=None)
            for each in sorted(found, key=attrgetter("cost"))
        ]
        improved = (self.improved(scene, each) for each in found)
        known = next((each for each in improved if isfinite(each.gap)), None)
        best = quicker(known, found[0]) if known else found[0]
        way = TakenWay(name_of_way(scene, best.trajectory), best.duration, True, best.trajectory)
        return [replace(best, ways=(way,))]
