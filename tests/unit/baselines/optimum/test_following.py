import numpy as np
import pytest

from baselines.optimum.following import Gaps, least_gaps, least_losses
from minisim.carfollowing import gap_ratio, idm
from minisim.laws import traits_of
from scenarios.profiles import FAIR, PAPER, Profile

DT = 0.1


def gaps_of(profile: Profile) -> Gaps:
    me = traits_of(profile.vehicle)
    return least_gaps(me, profile.speed_limit, DT, 480.0, me.b_max)


@pytest.mark.parametrize("profile", [FAIR, PAPER], ids=lambda it: it.name)
def test_the_curve_is_near_the_gap_that_the_idm_wants(profile: Profile) -> None:
    it, curve = profile.vehicle, gaps_of(profile)
    wanted = it.min_gap + curve.speed * it.headway
    assert (np.diff(curve.gap) >= 0.0).all()
    assert (curve.gap <= wanted + 1e-9).all()
    assert (curve.gap >= 0.6 * wanted).all()


@pytest.mark.parametrize("stepwise", [False, True])
@pytest.mark.parametrize("profile", [FAIR, PAPER], ids=lambda it: it.name)
def test_no_leader_brings_a_vehicle_below_the_curve(profile: Profile, stepwise: bool) -> None:
    rng, me, curve = np.random.default_rng(1), traits_of(profile.vehicle), gaps_of(profile)
    limit = profile.speed_limit
    for _ in range(40):
        v = w = float(rng.uniform(0.0, limit))
        gap = me.min_gap + v * me.headway
        for k in range(300):
            if k % 10 == 0:
                does = float(rng.choice([-me.b_max, -2.0, 0.0, me.a]))
            z = gap_ratio(v, gap, w, me.a, me.b, me.headway, me.min_gap)
            acc = max(idm(v, limit, z, me.a, me.b, me.delta), -me.b_max)
            after, ahead = max(v + acc * DT, 0.0), min(max(w + does * DT, 0.0), limit)
            gap += (ahead - after if stepwise else (w + ahead - v - after) / 2.0) * DT
            v, w = after, ahead
            assert gap >= np.interp(v, *curve) - 1e-9


def test_a_short_road_leaves_less_time_to_fall_back() -> None:
    me = traits_of(FAIR.vehicle)
    near, far = (least_gaps(me, 14.0, DT, driven, me.b_max).gap for driven in (20.0, 480.0))
    assert (near <= far).all()
    assert (near < far).any()


def losses(behind: float, far: float = 450.0, gone: float = 480.0) -> float:
    me = traits_of(FAIR.vehicle)
    table = least_losses(me, 14.0, DT, 5.0, far, gone, 14.0, far / 14.0, 0.1, 300)
    return float(table[round(behind / 0.1)])


def driven_behind(behind: float, far: float = 450.0) -> float:
    """What a vehicle really loses behind one that drives at the limit, without any bound."""
    me, s, v, t = traits_of(FAIR.vehicle), 0.0, 14.0, 0.0
    gap = 14.0 * behind - me.length
    while s < far:
        z = gap_ratio(v, gap, 14.0, me.a, me.b, me.headway, me.min_gap)
        after = v + idm(v, 14.0, z, me.a, me.b, me.delta) * DT
        way = (v + after) / 2.0 * DT
        s, gap, v, t = s + way, gap + 14.0 * DT - way, after, t + DT
    return t - (s - far) / v - far / 14.0


@pytest.mark.parametrize("behind", [3.0, 5.0, 10.0])
def test_a_vehicle_loses_a_little_more_than_the_least(behind: float) -> None:
    assert 0.7 * driven_behind(behind) < losses(behind) <= driven_behind(behind)


def test_losses_fall_with_the_time_behind_and_end_with_the_leader() -> None:
    assert losses(0.0) > losses(2.0) > losses(5.0) > losses(20.0) > 0.0
    assert losses(0.0) - losses(1.0) <= 1.0 + 1e-9  # it may as well wait
    assert losses(5.0, gone=60.0) == pytest.approx(
        0.0, abs=1e-9
    )  # the leader is gone before this one comes
