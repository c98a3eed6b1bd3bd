"""Car-following laws as pure functions of plain floats, compiled if numba is installed.

All values are in SI units. Under the IDM a vehicle keeps its acceleration for one step
(`ballistic`). Krauß's law gives the next speed instead, at which a vehicle drives the whole step
(`semi_implicit`), as in SUMO by default.
"""

from __future__ import annotations

import math

from minisim.jit import njit_inline, njit_inner

#: A vehicle with less than this to go has arrived [m]: an approach that gets slower as the distance
#: shrinks would never end (SUMO's `NUMERICAL_EPS`, in the same place).
STILL = 1e-3

#: A next speed below this, times dt, counts as standstill [m/s²] (`NUMERICAL_EPS_SPEED`).
STANDSTILL = 1e-4


@njit_inline
def free_road(r: float, a: float, b: float, delta: float) -> float:
    """IDM acceleration on an empty road, a·(1 − r^δ) [m/s²], r = v/v0.

    Above the desired speed (when a limit begins late), a vehicle brakes at b at most.
    Source: Treiber, Hennecke, Helbing 2000, PRE 62:1805, eq. 3 without interaction.
    """
    if delta == 4.0:
        r = r * r
        power = r * r
    else:
        power = r**delta
    acc = a * (1.0 - power)
    return acc if acc > -b else -b


@njit_inline
def gap_ratio(
    v: float, gap: float, v_leader: float, a: float, b: float, headway: float, min_gap: float
) -> float:
    """Desired over actual gap, z = s*/gap, with s* = s0 + max(0, vT + v·Δv / (2√(ab))).

    Infinite for a gap ≤ 0: that is a collision, and no floor hides it. Among several
    leaders, the one with the largest z decides, in both the IDM and the improved IDM.
    Source: Treiber, Hennecke, Helbing 2000, PRE 62:1805, eq. 4; Δv = v − v_leader.
    """
    if gap <= 0.0:
        return math.inf
    dynamic = v * headway + v * (v - v_leader) / (2.0 * math.sqrt(a * b))
    return (min_gap + (dynamic if dynamic > 0.0 else 0.0)) / gap


@njit_inline
def idm(v: float, v0: float, z: float, a: float, b: float, delta: float) -> float:
    """IDM acceleration, a·(1 − (v/v0)^δ − z²) [m/s²], z from `gap_ratio` (0 without a leader).

    Source: Treiber, Hennecke, Helbing 2000, PRE 62:1805, eq. 3.
    """
    return free_road(v / v0, a, b, delta) - a * z * z


@njit_inline
def iidm(v: float, v0: float, z: float, a: float, b: float, delta: float) -> float:
    """Improved IDM acceleration [m/s²]: the equilibrium gap is s0 + vT at all speeds up to v0.

    Source: Treiber, Kesting, Traffic Flow Dynamics, 2013, ch. 11.3.7.
    """
    if v > v0:
        acc_free = -b * float(1.0 - (v0 / v) ** (a * delta / b))
        return acc_free + a * (1.0 - z * z) if z >= 1.0 else acc_free
    if z >= 1.0:
        return a * (1.0 - z * z)
    acc_free = free_road(v / v0, a, b, delta)
    if acc_free <= 0.0:  # v = v0: the exponent 2a/a_free is infinite and its term vanishes
        return acc_free
    return acc_free * float(1.0 - z ** (2.0 * a / acc_free))


@njit_inner
def safe_speed(gap: float, v_leader: float, b: float, headway: float, dt: float) -> float:
    """Krauß's safe speed: the highest at which a leader that brakes at b causes no collision.

    A vehicle that keeps it for `headway` and then slows by b·dt per step uses up `gap` (beyond the
    gap at standstill) plus the leader's braking distance. So the equilibrium gap is v·headway for
    any step. For dt → 0 this is Krauß's −bT + √(b²T² + v_l² + 2b·gap). 0 for a gap ≤ 0.
    Source: Krauß 1998, Microscopic Modeling of Traffic Flow, §3.1 (eq. 3.7, leader and follower
    alike); in whole braking steps, as SUMO's `MSCFModel::maximumSafeFollowSpeed` (not ballistic).
    """
    room = gap - STILL
    if room < 0.0:
        return 0.0
    room += braking_distance(v_leader, b, dt)
    pace = headway / dt - 0.5
    unit = b * dt * dt
    steps = math.floor(math.sqrt(pace * pace + 2.0 * room / unit) - pace)
    rest = room - unit * steps * (pace + 0.5 * steps)
    return steps * b * dt + rest / (headway + steps * dt)


@njit_inner
def braking_distance(v: float, b: float, dt: float) -> float:
    """Distance to standstill when each step, including this one, is b·dt slower than the last [m].

    Source: SUMO's `MSCFModel::brakeGap` without the ballistic rule.
    """
    steps = math.floor(v / (b * dt))
    return dt * steps * (v - 0.5 * b * dt * (steps + 1.0))


@njit_inner
def stepwise_towards(v_target: float, distance: float, b: float, dt: float) -> float:
    """`speed_towards` for `semi_implicit`: the highest next speed that still allows `v_target`.

    One step at that speed, and slowing by b·dt per step to `v_target`, take `distance`.
    Source: SUMO's `MSCFModel::freeSpeed`, and `stopSpeed` for v_target = 0.
    """
    if distance <= v_target * dt:
        return v_target
    pace = 0.5 + v_target / (b * dt)
    unit = b * dt * dt
    room = distance - v_target * dt
    steps = math.floor(math.sqrt(pace * pace + 2.0 * room / unit) - pace)
    rest = room - unit * steps * (pace + 0.5 * steps)
    return v_target + steps * b * dt + rest / ((steps + 1.0) * dt)


@njit_inner
def krauss(v: float, v0: float, v_safe: float, a: float, b: float, dt: float) -> float:
    """Next speed [m/s]: the lowest of the desired, attainable and safe speeds.

    Above the desired speed (when a limit begins late), a vehicle brakes at b at most.
    Source: Krauß 1998, §3.1, without the random part (SUMO's sigma = 0).
    """
    v_new = min(v + a * dt, max(v0, v - b * dt), v_safe)
    return v_new if v_new >= STANDSTILL * dt else 0.0


@njit_inline
def speed_towards(v: float, v_target: float, distance: float, b: float, dt: float) -> float:
    """Highest speed after one step that still allows `v_target` at `distance`, braking at b.

    Solves (v + v')/2·dt + (v'² − v_target²)/(2b) = distance for v', which is negative if the
    vehicle has to stop within this step. A vehicle at this bound brakes at exactly b and no earlier
    than it must. Krauß's safe speed (1998, §2) with a ballistic step is the same construction.
    """
    half = 0.5 * b * dt
    disc = half * half + v_target * v_target + 2.0 * b * distance - b * dt * v
    if disc < 0.0:
        return v - b * dt
    return math.sqrt(disc) - half


@njit_inner
def stop_within(v: float, distance: float, b: float, dt: float) -> float:
    """Highest acceleration in a ballistic step after which braking at b stops within `distance`.

    It is at least -b if braking from now on stops within `distance` too.
    Source: SUMO's `MSCFModel::maximumSafeStopSpeedBallistic` with a reaction time of one step.
    """
    if v * dt > 2.0 * distance:  # it has to stop within this step
        return -v * v / (2.0 * max(distance, 1e-9))
    return (speed_towards(v, 0.0, distance, b, dt) - v) / dt


@njit_inline
def ballistic(s: float, v: float, acc: float, dt: float) -> tuple[float, float]:
    """Position and speed after one step of constant acceleration; it ends at a standstill.

    Source: Treiber, Kanagaraj 2015, arXiv 1403.4881, eq. 9–10.
    """
    v_new = v + acc * dt
    if v_new < 0.0:
        return s - v * v / (2.0 * acc), 0.0
    return s + v * dt + 0.5 * acc * dt * dt, v_new


@njit_inline
def semi_implicit(s: float, v: float, acc: float, dt: float) -> tuple[float, float]:
    """Position and speed after one step of SUMO's default rule, s + v'·dt with the new speed v'.

    A vehicle that would reverse stands still. Source: SUMO's `step-method` (semi-implicit Euler).
    """
    v_new = max(v + acc * dt, 0.0)
    return s + v_new * dt, v_new


@njit_inner
def insertion_speed(
    gap: float, v_leader: float, a: float, b: float, headway: float, min_gap: float
) -> float:
    """Highest speed whose desired gap s* does not exceed `gap`; negative if there is none.

    Solves s0 + vT + v·(v − v_leader) / (2√(ab)) = gap for v. Source: SUMO's insertion rule for the
    IDM, by its secure gap (`MSCFModel_IDM::getSecureGap`): no vehicle starts by braking hard.
    """
    room = gap - min_gap
    if room < 0.0:
        return -1.0
    root = math.sqrt(a * b)
    half = 0.5 * v_leader - root * headway
    return half + math.sqrt(half * half + 2.0 * root * room)


@njit_inline
def cruise_control(v: float, v0: float, gain: float, a: float, b: float) -> float:
    """Acceleration that a cruise control asks of the engine, gain·(v0 − v) within [−b, a] [m/s²].

    Rajamani, Vehicle Dynamics and Control, 2006, eq. 5.5 without integral; `MSCFModel_CC::_cc`.
    """
    return min(max(gain * (v0 - v), -b), a)


@njit_inline
def distance_control(
    v: float, gap: float, v_leader: float, headway: float, gain: float, spacing: float
) -> float:
    """Acceleration that an ACC asks of the engine behind a leader [m/s²].

    −((v − v_leader) + gain·(headway·v + spacing − gap)) / headway: in equilibrium the gap is
    headway·v + spacing. Like SUMO, callers measure `gap` beyond the vehicle's `min_gap`.
    Source: Rajamani 2006, eq. 6.18; SUMO's `MSCFModel_CC::_acc`.
    """
    return -((v - v_leader) + gain * (headway * v + spacing - gap)) / headway


@njit_inline
def engine_lag(a: float, u: float, lag: float, dt: float) -> float:
    """Acceleration of the next step when the engine, now at `a`, is asked for `u` [m/s²].

    First-order lag by the implicit Euler rule: α·u + (1 − α)·a with α = dt/(lag + dt).
    Source: SUMO's `FirstOrderLagModel` (Plexe; Segata et al., VNC 2014).
    """
    alpha = dt / (lag + dt)
    return alpha * u + (1.0 - alpha) * a
