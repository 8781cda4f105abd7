"""Flows by the equations that they are solutions of: Newton's law, and energies whose rates are the powers.

With c' = G c the amplitudes' own equation, G the eigenvalues and the growth of driven modes, a functional f has the
rate f G: every check is an identity for any amplitudes.
"""

import numpy as np
import pytest

from tests.coupling.engine.line.test_subsystem_motion import add_flow, random_system
from vanedamp.coupling.engine.known import IllConditioned
from vanedamp.coupling.engine.line.flow_assembly import fill, new_assembly_scratch
from vanedamp.coupling.engine.line.subsystem_assembly import empty_flows
from vanedamp.coupling.engine.line.subsystems import new_known
from vanedamp.coupling.numerics.codes import (
    CALM,
    DIFFERENCE,
    FREE_MOMENTUM_MAP,
    HARMONIC_MAP,
    MEAN_MAP,
    MOMENTUM_MAP,
    SINGLE,
    SUM,
    WORK_MAP,
)

#: of a scene: harmonics; factor of its damping and of its softest stiffness; springs of its contacts, N/m; whether a
#: harmonic is at the frequency of its stiffest mode
KINDS = {
    "regular": (1, 1.0, 1.0, None, False),
    "harmonics": (3, 1.0, 1.0, None, False),
    "overdamped": (2, 60.0, 1.0, None, False),
    "springs": (1, 1.0, 1.0, 30.0, False),
    "springs and harmonics": (3, 1.0, 1.0, 300.0, False),
    "driven": (1, 1e-6, 1.0, None, True),
    "two driven": (2, 1e-6, 1.0, None, True),
    "driven on springs": (2, 1e-6, 1.0, 30.0, True),
    "undamped": (1, 0.0, 1.0, None, True),
    "calm": (2, 1e-4, 1e-10, None, False),
    "calm on springs": (1, 1e-4, 1e-10, 1e-6, False),
}


def system_of(kind, seed, modes, bodies, proportional):
    e, damping, soft, spring, resonant = KINDS[kind]
    system, rng = random_system(seed, modes, bodies, "three", proportional)
    size, stiffness, omega = modes + bodies, system.stiffness.copy(), system.omega
    stiffness[0] *= soft
    if resonant:
        omega = np.sqrt(stiffness[modes - 1]) / e
        if modes > 1 and e > 1:
            stiffness[0] = omega**2
    loads = rng.normal(size=(2, e, size))
    # a base shakes the bodies of a cavity, the first two, alike
    loads[:, :, modes:] = system.mass[modes:] * loads[:, :, modes + np.maximum(np.arange(bodies) - 1, 0)]
    system = system._replace(
        stiffness=stiffness, damping=damping * system.damping, omega=omega, frequency=omega * np.arange(1, e + 1),
        period=2 * np.pi / omega, load=loads[0] + 1j * loads[1], table=rng.normal(size=e) + 1j * rng.normal(size=e),
    )  # fmt: skip
    if spring is not None:
        springs, dashpots, contacts = system.spring.copy(), system.dashpot.copy(), slice(system.friction_rows, None)
        springs[contacts] = spring * rng.uniform(0.5, 2.0, len(springs[contacts]))
        dashpots[contacts] = 0.01 * damping * rng.uniform(0.5, 2.0, len(springs[contacts]))
        system = system._replace(spring=springs, dashpot=dashpots)
    return system, rng


def subsystems_of(system, rng, count=6):
    """Random closed rows, those without springs independent of each other."""
    yield np.zeros(len(system.J), bool)
    for _ in range(count):
        key = rng.random(len(system.J)) < rng.choice([0.2, 0.5])
        rigid = np.flatnonzero(key & np.isinf(system.spring))
        if len(rigid) == 0 or np.linalg.matrix_rank(system.J[rigid], tol=1e-6) == len(rigid):
            yield key


class Place:
    """A place of the flows, cut to its m complex modes; G (m, m): rate of the amplitudes."""

    def __init__(self, system, flows, s=0):
        self.m, self.e = int(flows.modes[s]), len(system.frequency)
        self.flows, self.s = flows, s
        self.G = np.diag(flows.eigenvalue[s, : self.m])
        for h in range(self.e):
            for j in range(flows.driven[s, h], flows.driven[s, h + 1]):
                self.G[j, h] = flows.load[s, j]

    def __getattr__(self, name):
        return getattr(self.flows, name)[self.s]

    def functional(self, name):
        return getattr(self, name)[..., : self.m]

    def slow(self):
        """(pair's index, j, k, kind) of the list of slow pairs."""
        return [(i, *self.flows.slow[self.s, i, :3]) for i in range(self.slow_count)]


@pytest.fixture(
    scope="module", params=[(kind, modes, bodies) for kind in KINDS for modes, bodies in ((1, 1), (4, 2))], ids=str
)
def places(request):
    """Subsystems of some scenes of a kind: (system, place, amplitudes)."""
    kind, modes, bodies = request.param
    found = []
    for seed in range(3):
        system, rng = system_of(kind, seed, modes, bodies, proportional=seed == 1)
        for key in subsystems_of(system, rng):
            flows = add_flow(empty_flows(system, 1), system, key)
            place, draw = Place(system, flows), rng.normal(size=(2, flows.eigenvalue.shape[1]))
            assert np.array_equal(place.active_set, key)
            found.append((system, place, (draw[0] + 1j * draw[1])[: place.m]))
    if "driven" in kind or kind == "undamped":
        assert any(place.driven[place.e] > place.e for _, place, _ in found)
    if "calm" in kind:
        assert any(what == CALM for _, place, _ in found for *_, what in place.slow())
    return found


def positions(system, place):
    """Functionals of (p, x): a body is on its floor, by its slip."""
    p = place.shape[: place.m, : system.modes].T
    return np.vstack([p, place.functional("motion")[: system.bodies] + system.floor @ p])


def close(one, other, terms, tolerance=1e-11):
    assert np.abs(one - other).max(initial=0.0) <= tolerance * max(np.abs(terms).max(initial=0.0), 1e-300)


def test_newtons_law(places):
    """M q'' + C q' + K q = load + J^T force; rows move as J q, closed rigid ones not at all."""
    for system, place, _ in places:
        n, m, e, G = system.modes, place.m, place.e, place.G
        q = positions(system, place)
        load = np.zeros((len(q), m), complex)
        load[:, :e] = system.load.T
        terms = [system.mass[:, None] * (q @ G @ G), system.damping @ q @ G, system.stiffness[:, None] * q]
        force = place.functional("force")
        close(sum(terms), load + system.J.T @ force, np.abs(terms).max() + np.abs(system.J.T).max() * np.abs(force))
        close(place.shape[:m, n:].T, q[:n] @ G, np.abs(q[:n] @ G) + np.abs(q[:n]))
        close(place.functional("motion"), system.J @ q, np.abs(system.J) @ np.abs(q))
        close(place.functional("velocity"), place.functional("motion") @ G, np.abs(q @ G))
        key, rigid = place.active_set, np.isinf(system.spring)
        close(place.functional("motion")[key & rigid], 0.0, np.abs(system.J[key & rigid]) @ np.abs(q), 1e-12)
        assert not force[~key].any()
        soft = key & ~rigid
        stretch = system.J[soft] @ q
        push = -system.spring[soft, None] * stretch - system.dashpot[soft, None] * (stretch @ G)
        close(force[soft], push, push)
        close(place.functional("impulse")[soft] @ G, force[soft], force)
        close(place.functional("response")[e:], system.response[:n] @ q[:n, e:], 1.0)
        close(place.functional("response")[:e], system.response[:n] @ q[:n, :e] + system.table, 1.0 + np.abs(q))
        close(place.functional("momentum"), system.mass[n:] @ q[n:] @ G, system.mass.max() * (np.abs(q) @ np.abs(G)))


def test_sizes_of_modes(places):
    for system, place, _ in places:
        m, n, rate = place.m, system.modes, np.abs(place.functional("eigenvalue"))
        size = np.abs(np.vstack([place.functional("motion"), place.functional("response")])).max(axis=0)
        close(place.functional("speed"), size * rate, size * rate)
        assert (place.functional("acceleration") >= size * rate**2 * (1 - 1e-12)).all()
        for level, factor in enumerate(place.functional("grid_factor")):
            step = system.period / 8 / 2**level
            assert factor == pytest.approx(np.exp(place.functional("eigenvalue") * step), rel=1e-13)
        for j in range(m):
            moved = np.flatnonzero(place.shape[j, :n] + 1j * place.shape[j, n:])
            assert list(place.support[j]) == ([moved[0], moved[-1] + 1] if len(moved) else [0, 0])
        assert not place.functional("impulse_response")[:, : place.e].any()
        on_rows = system.J[:, :n] @ place.project[place.e : m, n:].T
        close(place.functional("impulse_response")[:, place.e :], on_rows, on_rows)


def power_of(form, place, c):
    """Rate of a form of the amplitudes, and the size of its terms."""
    x, rate = (np.ascontiguousarray(part).view(float) for part in (c, place.G @ c))
    form = form[: 2 * place.m, : 2 * place.m]
    assert np.array_equal(form, form.T)
    return 2 * x @ form @ rate, 2 * np.abs(x) @ np.abs(form) @ np.abs(rate)


def of_pairs(place, parts, c):
    """Power of the slow pairs: the parts of the list times their products."""
    total = 0.0
    for i, j, k, kind in place.slow():
        if kind in (SUM, DIFFERENCE):
            total += (parts[i] * c[j] * (c[k] if kind == SUM else c[k].conjugate())).real
    return total


def test_quadratic_forms_are_antiderivatives_of_powers(places):
    """Loss of the structure, loss in dashpots and squared response, with the pairs that are left to their series."""
    for system, place, c in places:
        n, m = system.modes, place.m
        calm = np.zeros(m, bool)
        calm[[j for _, j, _, kind in place.slow() if kind == CALM]] = True
        speed = (place.shape[:m, n:].T @ c).real
        sprung = place.active_set & np.isfinite(system.spring)
        stretch, x = (place.functional("velocity")[sprung] @ c).real, place.functional("response") * c
        for form, parts, power in (
            (place.loss, place.slow_loss, speed @ system.damping[:n, :n] @ speed),
            (place.dashpot, place.slow_dashpot, system.dashpot[sprung] @ stretch**2),
            (place.square, place.slow_square, x.sum().real ** 2 - x[calm].sum().real ** 2),
        ):
            rate, terms = power_of(form, place, c)
            # the form of a calm mode is divided by its small rate, and then multiplied by it
            close(rate + of_pairs(place, parts, c), power, terms + abs(power), 1e-9)


def mapped(place, first, c):
    """The two numbers, as x + i y, that a linear map makes of the amplitudes, and the size of its terms."""
    x, rows = np.ascontiguousarray(c).view(float), place.linear[: place.m, first : first + 4]
    rows = rows.reshape(-1, 2, 2).swapaxes(0, 1).reshape(2, -1)
    return complex(*(rows @ x)), np.abs(rows) @ np.abs(x)


def test_linear_maps_are_antiderivatives(places):
    """Harmonic, momentum, mean and work of the loads; momentum of the free bodies."""
    for system, place, c in places:
        n, e, m, rate = system.modes, place.e, place.m, place.G @ c
        q = positions(system, place)
        speeds = (q @ rate).real
        for first, name in ((HARMONIC_MAP, "response"), (MOMENTUM_MAP, "momentum")):
            functional, turned = place.functional(name), c[0].conjugate()
            (now, size), (after, more) = mapped(place, first, c), mapped(place, first, rate)
            found = turned * after + rate[0].conjugate() * now
            for _, j, k, kind in place.slow():
                if kind == DIFFERENCE and k == 0:
                    found += 0.5 * functional[j] * c[j] * turned
            exact = turned * (functional @ c).real
            close(found, exact, abs(turned) * more + abs(rate[0]) * size + abs(exact))
        for h in range(e):
            first = WORK_MAP + 4 * h
            (now, size), (after, more) = mapped(place, first, c), mapped(place, first, rate)
            found = (c[h].conjugate() * after + rate[h].conjugate() * now).real
            for _, j, k, kind in place.slow():
                if kind == DIFFERENCE and k == h:
                    found += 0.5 * (place.work[h, j] * c[j] * c[h].conjugate()).real
            exact = (system.load[h] * c[h]).real @ speeds
            close(found, exact, abs(c[h]) * more + abs(rate[h]) * size + np.abs(system.load[h] * speeds).sum())
        x, turned, shown = np.ascontiguousarray(rate).view(float), 0.0, place.functional("response") * c
        for i, j, _, kind in place.slow():
            if kind == SINGLE:
                turned += (place.slow_square[i] * c[j]).real
            elif kind == CALM:
                turned += 2 * shown[j].real
        mean = place.linear[:m, MEAN_MAP : MEAN_MAP + 2].ravel()
        close(mean @ x + turned, 2 * shown.sum().real, np.abs(mean) @ np.abs(x) + np.abs(shown).sum())
        free = np.diagonal(place.body_acceleration) != 0
        momentum = system.mass[n:][free] @ place.functional("velocity")[: system.bodies][free]
        columns = place.linear[:m, FREE_MOMENTUM_MAP : FREE_MOMENTUM_MAP + 2]
        close(columns[:, 0] - 1j * columns[:, 1], momentum, momentum)


def test_impulses_change_forms_and_maps(places):
    """Where impacts between free flights happen: no rigid row is closed."""
    for system, place, _ in places:
        if np.isinf(system.spring[place.active_set]).any():
            continue
        change = np.ascontiguousarray(place.functional("impulse_response")).view(float)
        for i, form in enumerate((place.loss, place.square, place.dashpot)):
            exact = change @ form[: 2 * place.m, : 2 * place.m]
            close(place.kick[:, i, : 2 * place.m], exact, np.abs(change) @ np.abs(form[: 2 * place.m, : 2 * place.m]))
        maps = place.linear[: place.m].reshape(place.m, -1, 2).swapaxes(1, 2).reshape(2 * place.m, -1)
        close(place.kick_maps, change @ maps, np.abs(change) @ np.abs(maps))


def test_known_subsystems_serve_all_frequencies():
    """Each is found once; a place that is filled again is as if it were new."""
    system, rng = system_of("two driven", 0, 4, 2, False)
    keys, known, scratch = [*subsystems_of(system, rng, 12)], new_known(system), new_assembly_scratch(system)
    assert not known
    for factor in (1.0, 1.7):
        now = system._replace(
            omega=factor * system.omega, period=system.period / factor, frequency=factor * system.frequency
        )
        flows, k = empty_flows(system, len(keys)), [known.place(now, key) for key in keys]
        for s, key in enumerate(keys):
            assert fill(now, known.stack, k[s], flows, s, scratch)
            assert np.array_equal(flows.active_set[s], key)
        assert len(set(k)) == np.count_nonzero(known.stack.number) == len({key.tobytes() for key in keys})
        for s, key in enumerate(keys):
            alone = add_flow(empty_flows(now, 1), now, key)
            # filled before at another frequency, and now at this one
            assert fill(system, known.stack, k[s], flows, s, scratch)
            assert fill(now, known.stack, k[s], flows, s, scratch)
            for name, part in alone._replace(subsystem=known.stack.number[k[s]][None])._asdict().items():
                listed = slice(alone.slow_count[0] if name.startswith("slow") and part.ndim > 1 else None)
                assert np.array_equal(np.atleast_1d(getattr(flows, name)[s])[listed], np.atleast_1d(part[0])[listed])
    assert known


def test_subsystems_that_doubles_cannot_resolve():
    system, _ = system_of("regular", 0, 1, 1, True)
    key = np.zeros(len(system.J), bool)
    key[0] = True
    with pytest.raises(IllConditioned):  # 1e14 times the gap
        add_flow(empty_flows(system), system._replace(weight=1e14 * np.ones(2)), key)
    add_flow(empty_flows(system), system._replace(weight=np.ones(2)), key)
