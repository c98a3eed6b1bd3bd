"""Environments keep the contracts of Gymnasium and PettingZoo, and their own."""

from __future__ import annotations

import copy
import dataclasses
import pickle
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

from baselines import MaxPressure
from dim import Dim
from dim.decision import DecisionTable
from minisim import simulate
from minisim.control import HALTING
from minisim.errors import InputError
from minisim.junction.movements import movements_of
from minisim.simulation import Simulation
from minisim.stepping import repeated
from scenarios import five_way, four_way, three_way
from scenarios.scenario import Scenario
from tests.builders import digest

gymnasium = pytest.importorskip("gymnasium", reason="needs the extra gym")
pettingzoo_test = pytest.importorskip("pettingzoo.test", reason="needs the extra gym")

from gymnasium.utils.env_checker import check_env  # noqa: E402
from pettingzoo.utils.conversions import parallel_to_aec  # noqa: E402

import scenarios.environments as environments  # noqa: E402

NAMES = ("minisim/RightOfWay-v0", "minisim/Signal-v0")


def short(seconds: float = 60.0, density: float = 300.0) -> Scenario:
    return four_way(density=density, horizon=seconds, warmup=0.0)


def episode(env: Any, seed: int, steps: int = 10**6) -> tuple[list[float], dict[str, Any]]:
    """The rewards of an episode of random actions, and the last information."""
    env.action_space.seed(seed)
    env.reset(seed=seed)
    rewards = []
    for _ in range(steps):
        seen, reward, terminated, truncated, info = env.step(env.action_space.sample())
        assert env.observation_space.contains(seen)
        rewards.append(reward)
        if terminated or truncated:
            break
    return rewards, info


@pytest.mark.filterwarnings("ignore:no window")  # it also makes one that shows a window
@pytest.mark.parametrize("name", NAMES)
def test_gymnasiums_checks(name: str) -> None:
    check_env(gymnasium.make(name, scenario=short(30.0), render_mode="rgb_array").unwrapped)


def test_pettingzoos_checks() -> None:
    """Vehicles that come after the last step never live, which the test would warn of."""

    def make() -> environments.VehiclesEnv:
        return environments.VehiclesEnv(short(120.0, density=500.0))

    with pytest.warns(UserWarning, match="No agents present but not all possible_agents"):
        pettingzoo_test.parallel_api_test(make(), num_cycles=100)
    pettingzoo_test.parallel_seed_test(make, num_cycles=20)
    with pytest.warns(UserWarning, match="all zeros"):  # of one that has left
        pettingzoo_test.api_test(parallel_to_aec(make()), num_cycles=200)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("make", [three_way, five_way])
def test_other_junctions_and_seeds(name: str, make: Any) -> None:
    env = gymnasium.make(name, scenario=make(density=400.0, horizon=60.0, warmup=0.0))
    first, info = episode(env, 3)
    assert "collision" not in info
    assert episode(env, 3)[0] == first != episode(env, 4)[0]


@pytest.mark.parametrize("name", NAMES)
def test_the_reward_is_the_time_spent_up_to_the_exit(name: str) -> None:
    """By the trajectories of the same run: which have come, and which have left the junction."""
    env = gymnasium.make(name, scenario=short(90.0, density=500.0))
    rewards, _ = episode(env, 1)
    world = env.unwrapped.world
    own = world.sim.result()
    again = Simulation(
        own.scenario, own.controller, seed=own.seed, record="all", on_collision="record"
    )
    run = repeated(again, own.given, 90.0)
    frame, site, trips = run.trajectories, run.site, run.columns
    ways = site.intersection.movements.index_of[trips.lane, trips.manoeuvre]
    clear = np.array([path.exit for path in site.intersection.paths])[ways] + site.vehicle.length
    left_by = frame[frame["s_m"] >= clear[frame["vehicle"]]]
    gone = left_by.groupby("vehicle")["time_s"].min()
    times = world.interval * np.arange(1, len(rewards) + 1)
    come = (run.columns.demand_time[:, None] <= times + 1e-9).sum(axis=0)
    left = (gone.to_numpy()[:, None] <= times + 1e-9).sum(axis=0)
    assert left[-1] > 5
    assert rewards == pytest.approx(-(come - left) * world.interval)


def test_a_random_policy_cannot_crash_if_masked() -> None:
    _, info = episode(gymnasium.make(NAMES[0], scenario=short(300.0, density=350.0)), 0)
    assert "collision" not in info


@pytest.mark.slow
def test_no_collision_in_a_hundred_thousand_crossings() -> None:
    """Of a random policy, on 3, 4 and 5 arms; also one by one per vehicle."""
    crossed, seed = 0, 0
    while crossed < 100_000:
        for make in (three_way, four_way, five_way):
            scenario = make(density=300.0, horizon=3600.0, warmup=0.0)
            env = environments.RightOfWayEnv(scenario)
            _, info = episode(env, seed)
            assert "collision" not in info, (make, seed)
            crossed += int(env.world.sim.result().columns.arrived.sum())
            vehicles = environments.VehiclesEnv(scenario)
            random = np.random.default_rng(seed)
            vehicles.reset(seed=seed)
            while vehicles.agents:
                vehicles.step({agent: int(random.integers(2)) for agent in vehicles.agents})
            assert vehicles.world.collision is None
            crossed += int(vehicles.world.sim.result().columns.arrived.sum())
            seed += 1


def test_unmasked_a_random_policy_crashes_and_the_episode_ends_with_the_report() -> None:
    env = gymnasium.make(NAMES[0], scenario=short(600.0, density=350.0), masked=False)
    rewards, info = episode(env, 0)
    collision = env.unwrapped.world.collision
    assert collision is not None
    assert info["collision"] == str(collision)
    assert len(rewards) < 600


def test_masked_out_actions_have_no_effect() -> None:
    """All bits set is as good as those of the mask, and wishing for nothing holds everyone."""
    every = environments.RightOfWayEnv(short(120.0, density=400.0))
    masked = environments.RightOfWayEnv(short(120.0, density=400.0))
    (one, _), (other, info) = every.reset(seed=2), masked.reset(seed=2)
    over = False
    while not over:
        assert np.array_equal(one, other)
        one, _, _, over, _ = every.step(np.ones(12, np.int8))
        other, _, _, _, info = masked.step(info["action_mask"])
    assert every.world.sim.result().columns.arrived.sum() > 8
    held = environments.RightOfWayEnv(short(120.0, density=400.0))
    held.reset(seed=2)
    for _ in range(119):
        held.step(np.zeros(12, np.int8))
    assert not any(v.distance < 0.0 for v in held.world.sim.view().vehicles)


def test_an_observation_says_what_is_there() -> None:
    env = environments.RightOfWayEnv(short(200.0, density=500.0), sight=40.0)
    env.reset(seed=5)
    for step in range(150):
        seen, *_ = env.step(np.ones(12, np.int8) * (step % 3 == 0))
    view, lanes = env.world.sim.view(), seen[:32].reshape(4, 8)
    assert lanes[:, 0].sum() >= 3
    for lane in range(4):
        before = [v for v in view.vehicles if v.lane == lane and v.distance >= 0.0]
        standing = sum(v.speed <= HALTING for v in before)
        assert lanes[lane, 7] == pytest.approx(min(standing / 10.0, 1.0))
        if lanes[lane, 0]:
            front = before[0]
            assert lanes[lane, 1] == pytest.approx(front.distance / 40.0)
            assert lanes[lane, 3] == pytest.approx(min((view.time - front.demand_time) / 60.0, 1.0))
            assert np.flatnonzero(lanes[lane, 4:7]).tolist() == [front.manoeuvre - 1]


def test_a_signal_shows_one_phase_and_changes_after_its_shortest_green() -> None:
    env = environments.SignalEnv(short(120.0), min_green=12.0)
    seen, info = env.reset(seed=0)
    assert seen[:5].tolist() == [1, 0, 0, 0, 0]
    masks = [info["action_mask"].tolist()]
    for _ in range(6):
        seen, _, _, _, info = env.step(2)
        masks.append(info["action_mask"].tolist())
    assert masks[:3] == [[1, 0, 0, 0]] * 3, "12 s of green end between 10 and 15 s"
    assert seen[:4].tolist() == [0, 0, 1, 0]
    assert masks[3] == [0, 0, 1, 0], "the new green has just begun"
    assert masks[-1] == [1, 1, 1, 1]


def test_a_signal_that_always_asks_for_the_longest_queue_is_as_good_as_max_pressure() -> None:
    """Its step is 5 s, not 10, and it looks while others change: within a fifth."""
    scenario = four_way(density=200.0, horizon=1200.0, warmup=0.0)
    env = environments.SignalEnv(scenario)
    seen, _ = env.reset(seed=7)
    over = False
    while not over:
        present = seen[5:9]
        green = int(seen[:4].argmax())
        stays = present[green] > 0 or not present.any()
        seen, _, _, over, _ = env.step(green if stays else int(present.argmax()))
    run = env.world.sim.result()
    rival = simulate(scenario, MaxPressure(), run.seed)
    assert run.columns.arrived.sum() >= 0.8 * rival.columns.arrived.sum()


def algorithm_1(seen: Any, lane: int, table: DecisionTable) -> bool:
    """DIM's decision of a vehicle, from nothing but its observation."""
    first = np.roll(seen[:24].reshape(4, 6), lane, axis=0)
    settled = np.roll(seen[24:36].reshape(4, 3), lane, axis=0)
    asks = [k for k in range(4) if first[k, 0]]
    case = sum((int(first[k, 3:].argmax()) + 1) * 4**k for k in asks)
    bits = movements_of(4).bits
    occupied = sum(bits[k][j + 1] for k, j in zip(*np.nonzero(settled), strict=True))
    return bool(table.surely(case, 0, occupied, 0) >> lane & 1)


def test_dim_can_be_learnt_from_what_a_vehicle_sees() -> None:
    """Algorithm 1 on the observations gives the trips of DIM, to the last step."""
    scenario = short(200.0, density=350.0)
    env = environments.VehiclesEnv(scenario, interval=0.1)
    observations, _ = env.reset(seed=4)
    dim, site = Dim(gate="harmonious"), env.world.site
    table = DecisionTable(dim.harmony(site), dim.order, dim.ranks(site))
    lanes = env.world.sim.arrivals.lane.tolist()
    while env.agents:
        actions = {
            agent: int(algorithm_1(observations[agent], lanes[int(agent[8:])], table))
            for agent in env.agents
        }
        observations, *_ = env.step(actions)
    run = env.world.sim.result()
    assert run.columns.arrived.sum() > 30
    assert digest(run) == digest(simulate(scenario, dim, run.seed))


def test_vehicles_that_crash_pay_for_it() -> None:
    env = environments.VehiclesEnv(short(600.0, density=400.0), masked=False, crash=500.0)
    env.reset(seed=1)
    rewards: dict[str, float] = {}
    while env.agents:
        _, rewards, terminated, _, infos = env.step(dict.fromkeys(env.agents, 1))
    harmed = env.world.collision
    assert harmed is not None
    assert all(terminated.values())
    assert {info["collision"] for info in infos.values()} == {str(harmed)}
    assert sorted(int(a[8:]) for a, reward in rewards.items() if reward < -400) == list(
        harmed.vehicles
    )


def test_an_agent_is_told_what_it_may_do() -> None:
    env = environments.VehiclesEnv(short(300.0, density=500.0))
    _, infos = env.reset(seed=1)
    masks = set()
    while env.agents:
        masks |= {tuple(infos[agent]["action_mask"].tolist()) for agent in env.agents}
        _, _, _, _, infos = env.step({a: int(infos[a]["action_mask"][1]) for a in env.agents})
    assert masks == {(1, 0), (1, 1), (0, 1)}


@pytest.mark.parametrize(
    ("make", "wrong", "message"),
    [
        ("RightOfWayEnv", {"interval": 0.01}, "interval .* must be at least 0.1"),
        ("RightOfWayEnv", {"masked": 1}, "masked must be true or false"),
        ("RightOfWayEnv", {"scenario": "four-way"}, "scenario must be a Scenario"),
        ("SignalEnv", {"render_mode": "ansi"}, "unknown render_mode 'ansi'"),
        ("SignalEnv", {"amber": -1}, "amber"),
        ("VehiclesEnv", {"crash": 0}, r"crash \[s\] must be above 0"),
    ],
)
def test_wrong_arguments_are_told(make: str, wrong: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        getattr(environments, make)(**wrong)


@pytest.mark.parametrize("make", ["RightOfWayEnv", "VehiclesEnv"])
def test_pictures(make: str) -> None:
    """In a window only where there is a display; here it draws on a canvas without one."""
    env = getattr(environments, make)(short(150.0), render_mode="rgb_array")
    env.reset(seed=0)
    first = env.render()
    assert first.shape == (500, 500, 3)
    assert first.dtype == np.uint8
    env.world.sim.advance(env.world.sim.time + 50.0)
    assert (env.render() != first).any()
    env.close()


def test_a_window_without_a_display_warns(monkeypatch: pytest.MonkeyPatch) -> None:
    from matplotlib import pyplot

    monkeypatch.setattr(pyplot, "get_backend", lambda: "agg")
    env = environments.SignalEnv(short(30.0), render_mode="human")
    with pytest.warns(UserWarning, match="no window: matplotlib finds no display here"):
        env.reset(seed=0)
    env.step(0)
    assert env.render() is None
    env.close()


NOTHING = np.zeros(12, np.int8)


@pytest.mark.parametrize("make", ["RightOfWayEnv", "SignalEnv", "VehiclesEnv", "RightOfWayBatch"])
def test_what_has_not_begun_or_is_over_cannot_go_on(make: str) -> None:
    scenario = short(20.0, density=600.0)
    many = make == "RightOfWayBatch"
    env = (
        environments.RightOfWayBatch(1, scenario) if many else getattr(environments, make)(scenario)
    )
    nothing = {"SignalEnv": 0, "VehiclesEnv": {}, "RightOfWayBatch": NOTHING[None]}
    with pytest.raises(InputError, match=r"there is no run yet: call reset\(\) first"):
        env.step(nothing.get(make, NOTHING))
    if many:  # it begins again by itself
        return
    env.reset(seed=1)
    env.world.sim.advance(20.0)
    with pytest.raises(InputError, match=r"the episode ended at 20 s: call reset\(\) first"):
        env.step(nothing.get(make, NOTHING))


def test_after_a_collision_nothing_goes_on() -> None:
    env = environments.RightOfWayEnv(short(600.0, density=350.0), masked=False)
    _, info = episode(env, 0)
    with pytest.raises(InputError, match="the episode ended"):
        env.step(NOTHING)
    assert "collision" in info


@pytest.mark.parametrize(
    ("make", "actions"),
    [
        ("RightOfWayEnv", [NOTHING[:3], 5, None, "go", NOTHING + 2, NOTHING[None], [[1], [1, 2]]]),
        ("SignalEnv", [4, -1, None, "x", 1.5, [1]]),
        ("RightOfWayBatch", [NOTHING, np.zeros((2, 12)), np.zeros((1, 3)), np.full((1, 12), 0.5)]),
        ("VehiclesEnv", [None, [1], {}, {"vehicle_0": 2}, {"vehicle_0": 1, "vehicle_99": 1}]),
    ],
)
def test_wrong_actions_are_told(make: str, actions: list[Any]) -> None:
    scenario = short(60.0, density=600.0)
    env = getattr(environments, make)(scenario=scenario)
    env.reset(seed=1)
    for action in actions:
        with pytest.raises(InputError, match=r"must be|needs an action|is no agent now"):
            env.step(action)


@pytest.mark.parametrize("make", ["RightOfWayEnv", "VehiclesEnv"])
def test_an_environment_can_be_kept_and_copied(make: str) -> None:
    """As a pickle and by deepcopy, in the middle of an episode."""
    env = getattr(environments, make)(short(120.0, density=500.0))
    env.reset(seed=3)

    def on(it: Any, steps: int) -> list[float]:
        return [
            total(it.step(dict.fromkeys(it.agents, 1) if it.metadata.get("name") else NOTHING + 1))
            for _ in range(steps)
        ]

    def total(made: Any) -> float:
        return float(sum(made[1].values()) if isinstance(made[1], dict) else made[1])

    on(env, 20)
    twins = copy.deepcopy(env), pickle.loads(pickle.dumps(env))
    kept = on(env, 15)
    assert sum(kept) < 0.0
    assert [on(it, 15) for it in twins] == [kept, kept]


def test_horizons_truncate_and_empty_roads_terminate() -> None:
    quiet = dataclasses.replace(short(600.0, density=100.0), demand_time=30.0)
    env = environments.RightOfWayEnv(quiet)
    env.reset(seed=1)
    ends = (False, False)
    while not any(ends):
        _, _, *ends, _ = env.step(np.ones(12, np.int8))  # type: ignore[assignment]
    assert ends == [True, False]
    assert env.world.sim.time < 600.0


def test_without_the_extra_it_says_what_to_install() -> None:
    code = "import sys; sys.modules['pettingzoo'] = None; import scenarios.environments"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert "environments need pettingzoo: pip install 'minisim-traffic[gym]'" in done.stderr


@pytest.mark.parametrize(
    ("make", "masked"), [(three_way, True), (four_way, True), (four_way, False), (five_way, True)]
)
def test_a_batch_is_as_many_single_ones(make: Any, masked: bool) -> None:
    """Also when episodes end and begin again, each at its own time; with collisions if unmasked."""
    scenario = dataclasses.replace(make(density=400.0, horizon=90.0, warmup=0.0), demand_time=20.0)
    batch = gymnasium.make_vec(
        "minisim/RightOfWay-v0", num_envs=3, scenario=scenario, masked=masked
    )
    assert isinstance(batch, environments.RightOfWayBatch)
    single = [environments.RightOfWayEnv(scenario, masked=masked) for _ in range(3)]
    crashed = False
    seen, _ = batch.reset(seed=5)
    for k, env in enumerate(single):
        assert seen[k] == pytest.approx(env.reset(seed=5 + k)[0], abs=1e-6)
    random, begins, episodes = np.random.default_rng(1), [False] * 3, 0
    for _ in range(150):
        actions = random.integers(0, 2, batch.action_space.shape).astype(np.int8)
        seen, rewards, terminated, truncated, info = batch.step(actions)
        for k, env in enumerate(single):
            if begins[k]:
                own: Any = (*env.reset(), {})
                own = own[0], 0.0, False, False, own[1]
            else:
                own = env.step(actions[k])
            assert seen[k] == pytest.approx(own[0], abs=1e-6)
            assert rewards[k] == pytest.approx(own[1])
            assert (terminated[k], truncated[k]) == own[2:4]
            assert info["time"][k] == own[4]["time"]
            assert np.array_equal(info["action_mask"][k], own[4]["action_mask"])
            told = info["collision"][k] if info.get("_collision", [False] * 3)[k] else None
            assert told == own[4].get("collision")
            crashed |= told is not None
            begins[k] = own[2] or own[3]
            episodes += begins[k]
    assert episodes >= 3
    assert crashed != masked


def test_a_batch_of_none_and_seeds_of_each() -> None:
    with pytest.raises(InputError, match="num_envs must be an integer 1"):
        environments.RightOfWayBatch(0)
    batch = environments.RightOfWayBatch(2, short(100.0, density=600.0))
    with pytest.raises(InputError, match="2 junctions need as many seeds, got 3"):
        batch.reset(seed=[7, 7, 7])
    batch.reset(seed=[7, 7])
    for _ in range(60):
        seen, *_ = batch.step(np.ones((2, 12), np.int8))
    assert np.array_equal(seen[0], seen[1])
    assert seen[0].any()


def test_a_batch_goes_on_with_its_random_numbers() -> None:
    """As Gymnasium wants it: a reset without a seed is none with a new one."""
    kept = []
    for _ in range(2):
        batch = environments.RightOfWayBatch(3, short(60.0, density=600.0))
        batch.reset(seed=4)
        first = batch.vehicles.tolist()
        batch.reset()
        kept.append((first, batch.vehicles.tolist()))
    assert kept[0] == kept[1]
    assert kept[0][0] != kept[0][1]


@pytest.mark.parametrize("profile", ["as_run", "as_run_signals"])
def test_a_batch_of_vehicles_that_it_cannot_drive(profile: str) -> None:
    scenario = four_way(density=300.0, horizon=60.0, warmup=0.0, profile=profile)
    with pytest.raises(InputError, match=f"vehicles of the profile {profile}, which follow SUMO"):
        environments.RightOfWayBatch(2, scenario)
