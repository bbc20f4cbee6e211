"""Random characters for the native module: automatic weights, skeletons, retargeting, refinement, skinning, threads."""

import os
import signal
import threading

import numpy as np
import skinwright_native as native

NUMBERS = [0, 1, -1, 2, 3, 0.5, 1e-30, 1e30, -1e300, np.nan, np.inf, -np.inf, 1 << 31, 1 << 32, 1 << 63, 10**40, True]
NUMBERS += [None, "1", [1], {}, 1 + 1j, np.float32(0.25), np.int8(-1)]


def junk(rng):
    return NUMBERS[int(rng.integers(len(NUMBERS)))]


def spoiled(array, rng, share=0.08):
    """An array as it is, or as a careless caller hands it over: another type, shape, order, or entries beyond sense."""
    if rng.random() > share:
        return array
    match int(rng.integers(9)):
        case 0:
            return array[:0]
        case 1:
            return array[:-1]
        case 2:
            return np.asfortranarray(array)[::-1]
        case 3:
            return np.repeat(array, 2, axis=-1)[..., ::2]
        case 4:
            return array.astype(rng.choice(["f2", "f8", "i1", "i8", "u8", ">f4", "O", "c16", "U3"]))
        case 5:
            return array.reshape(-1)
        case 6:
            return array[None]
        case 7 if array.size and array.dtype.kind == "f":
            bad = array.copy()
            bad.reshape(-1)[rng.integers(bad.size)] = rng.choice([np.nan, np.inf, -1e38, 1e38, 1e-40])
            return bad
        case 8 if array.size and array.dtype.kind in "iu":
            bad = array.astype(np.int64)
            bad.reshape(-1)[rng.integers(bad.size)] = rng.choice([-1, -2, 1 << 20, 1 << 31, 1 << 40, (1 << 63) - 1])
            return bad
    return [array.tolist()]


def character(rng, length=None):
    """A closed tube with a chain of bones along it: positions, triangles, segments, parents, dense weights."""
    sides, rings, bones = int(rng.integers(3, 9)), int(rng.integers(3, 12)), length or int(rng.integers(1, 6))
    scale = 10.0 ** rng.integers(-3, 4)
    angle = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    height = np.repeat(np.linspace(0, 3, rings), sides)
    positions = np.stack([np.tile(np.cos(angle), rings) * 0.4, np.tile(np.sin(angle), rings) * 0.4, height], axis=1)
    ring = np.arange(sides)
    first = (ring[None] + sides * np.arange(rings - 1)[:, None]).ravel()
    after = ((ring + 1) % sides + sides * np.arange(rings - 1)[:, None]).ravel()
    walls = [np.stack([first, after, after + sides], 1), np.stack([first, after + sides, first + sides], 1)]
    fan = np.stack([0 * ring[2:], ring[1:-1], ring[2:]], 1)
    triangles = np.concatenate([*walls, fan[:, ::-1], fan + sides * (rings - 1)])
    ends = np.linspace(0, 3, bones + 1)
    segments = np.zeros((bones, 2, 3))
    segments[:, 0, 2], segments[:, 1, 2] = ends[:-1], ends[1:]
    middle = (ends[:-1] + ends[1:]) / 2
    dense = np.exp(-((height[:, None] - middle[None]) ** 2) * bones)
    dense /= dense.sum(axis=1, keepdims=True)
    if rng.random() < 0.2:
        positions[rng.integers(0, len(positions), 5)] = positions[0]
    return positions * scale, triangles, segments * scale, np.arange(bones) - 1, dense


def rows_of(dense):
    return native.Weights.from_dense(dense.astype(np.float32))


def frames(segments):
    made = np.tile(np.eye(4), (len(segments), 1, 1))
    made[:, :3, 3] = segments[:, 0]
    return made, np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)


def pose(rng, bones):
    turned = np.tile(np.eye(4), (bones, 1, 1))
    turned[:, :3, :] += rng.normal(size=(bones, 3, 4)) * rng.choice([0, 0.1, 1, 100])
    return turned


def keywords(rng, sound):
    """Some of the settings, now and then one of them junk."""
    names = [str(name) for name in rng.choice(list(sound), rng.integers(0, len(sound)), replace=False)]
    return {name: junk(rng) if rng.random() < 0.08 else sound[name]() for name in names}


def check_rows(found):
    """Finite, from 0 to 1, rows that sum to 1 or hold nothing."""
    values, sums = found.values, np.add.reduceat(np.append(found.values, 0), found.indptr[:-1])
    filled = np.diff(found.indptr) > 0
    assert np.isfinite(values).all() and (values >= 0).all() and (values <= 1 + 1e-6).all()
    assert np.abs(sums[filled] - 1).max(initial=0) < 1e-4, sums[filled]


def finish(job, rng):
    """The result of a job, or nothing if it was dropped."""
    if rng.random() < 0.3:
        job.cancel()
    return job.result() if rng.random() < 0.8 else None


def automatic(rng):
    positions, triangles, segments, parents, _ = character(rng)
    options = keywords(
        rng,
        {
            "method": lambda: str(rng.choice(["heat", "geodesic", "euclidean"])),
            "max_influences": lambda: int(rng.integers(6)),
            "resolution": lambda: float(rng.choice([16, 32, 128])),
            "stiffness": lambda: 10.0 ** rng.uniform(-2, 3),
            "threads": lambda: int(rng.integers(4)),
        },
    )
    arrays = [spoiled(array, rng) for array in (positions, triangles, segments, parents)]
    if rng.random() < 0.3:
        made = finish(native.start_automatic_weights(*arrays, **options), rng)
    else:
        made = native.automatic_weights(*arrays, **options)
    if made is not None:
        check_rows(made.weights)


def embed(rng):
    positions, triangles, segments, parents, _ = character(rng)
    options = keywords(rng, {"method": lambda: str(rng.choice(["medial", "template"])), "threads": lambda: 1})
    if rng.random() < 0.5:
        donor = character(rng, len(parents))
        options |= {"donor_positions": spoiled(donor[0], rng), "donor_triangles": spoiled(donor[1], rng)}
        options |= {"donor_weights": rows_of(donor[4])}
        if rng.random() < 0.4:
            options["mirror"] = spoiled(np.arange(len(parents)), rng, 0.3)
        if rng.random() < 0.4:
            options["landmarks"] = spoiled(rng.integers(0, 9, (3, 2)), rng, 0.3)
    arrays = [spoiled(each, rng) for each in (positions, triangles, segments[:, 0], segments[:, 1], parents)]
    made = finish(native.start_embed_skeleton(*arrays, **options), rng)
    if made is not None:
        assert np.isfinite(made.heads).all() and np.isfinite(made.tails).all()
        assert ((made.confidence >= 0) & (made.confidence <= 1)).all()


def retarget(rng):
    source, target = character(rng), character(rng)
    sound = {
        "method": lambda: str(rng.choice(["skeleton", "biharmonic"])),
        "max_influences": lambda: int(rng.integers(6)),
        "match_points": lambda: str(rng.choice(["surface", "vertices"])),
        "registration": lambda: bool(rng.random() < 0.3),
        "landmarks": lambda: spoiled(rng.integers(0, 9, (3, 2)), rng, 0.3),
        "source_parents": lambda: spoiled(source[3], rng, 0.3),
        "n_pairs": lambda: int(rng.integers(1, 30)),
        "max_stretch": lambda: rng.uniform(1, 10),
        "max_distance": lambda: rng.random(),
        "normal_length": lambda: rng.random(),
        "smoothing_iterations": lambda: int(rng.integers(4)),
        "smoothing_factor": lambda: rng.random(),
        "threads": lambda: int(rng.integers(4)),
    }
    bone_map = rng.integers(-1, len(target[3]), len(source[3]))
    if rng.random() < 0.5:
        bone_map = rng.integers(-1, len(source[3]), len(target[3]))
    arrays = [spoiled(source[0], rng), spoiled(source[1], rng), rows_of(source[4])]
    arrays += [spoiled(each, rng) for each in (*frames(source[2]), target[0], target[1], *frames(target[2]))]
    call = {"bone_map": spoiled(bone_map, rng), **keywords(rng, sound)}
    made = finish(native.start_retarget_weights(*arrays, **call), rng)
    if made is not None:
        check_rows(made.weights)


def refine(rng):
    positions, triangles, segments, parents, dense = character(rng)
    sound = {
        "cell": lambda: float(np.ptp(positions)) * rng.choice([0.03, 0.1, 1]),
        "stretch": lambda: rng.random() * 2,
        "volume": lambda: rng.random(),
        "bind": lambda: float(rng.choice([0, 1, 1.08, 3])),
        "energy": lambda: rng.random(),
        "self_collision": lambda: bool(rng.random() < 0.5),
        "threads": lambda: int(rng.integers(3)),
    }
    arrays = [spoiled(positions, rng), spoiled(triangles, rng), rows_of(dense), spoiled(parents, rng)]
    refiner = native.Refiner(*arrays, spoiled(segments, rng), **keywords(rng, sound))
    for _ in range(int(rng.integers(1, 4))):
        turned = spoiled(pose(rng, len(parents)), rng)
        made = refiner.solve(turned, quality=str(rng.choice(["live", "bake", "live", "best"])))
        assert made.shape == positions.shape and np.isfinite(made).all(), "a refined position is not finite"
        refiner.measure(turned, spoiled(made, rng))
        if rng.random() < 0.3:
            refiner.report()
    native.intersecting_pairs(spoiled(positions, rng), spoiled(triangles, rng))


def skinning(rng):
    positions, triangles, segments, parents, dense = character(rng)
    rows, turned = rows_of(dense), spoiled(pose(rng, len(parents)), rng)
    made = native.linear_blend(spoiled(positions, rng), rows, turned)
    assert np.isfinite(made).all()
    native.dual_quaternion_blend(spoiled(positions, rng), rows, turned, rest_bones=frames(segments)[0])
    poses = np.concatenate([pose(rng, len(parents)) for _ in range(2)])
    depth = native.penetration(positions, spoiled(triangles, rng), rows, positions, rows, spoiled(poses, rng))
    assert (depth >= 0).all()


def fill(rng):
    positions, triangles, _, _, dense = character(rng)
    kinds = rng.integers(0, 3 + (rng.random() < 0.05), len(positions))
    options = {"length": junk(rng)} if rng.random() < 0.1 else {"length": rng.random()}
    if rng.random() < 0.3:
        options["weld"] = spoiled(np.arange(len(positions)), rng, 0.5)
    if rng.random() < 0.5:
        options["confidence"] = spoiled(rng.random(len(positions)), rng, 0.3)
    made = native.fill(*(spoiled(each, rng) for each in (positions, triangles, kinds, dense)), **options)
    assert not np.isinf(made).any()


def threads(rng):
    """One object used from several Python threads: every answer is the one that a thread alone gets."""
    positions, triangles, segments, parents, dense = character(rng)
    rows, turned = rows_of(dense), pose(rng, len(parents))
    refiner = native.Refiner(positions, triangles, rows, parents, segments) if rng.random() < 0.3 else None
    source = native.Source(positions, triangles, rows)
    inpainting = native.Inpainting(source, positions * 1.01, triangles)
    job = native.start_automatic_weights(positions, triangles, segments, parents, resolution=16)
    calls = {
        "blend": lambda: native.linear_blend(positions, rows, turned).tobytes(),
        "transfer": lambda: source.transfer(positions * 1.01, triangles).weights.values.tobytes(),
        "solve": lambda: inpainting.solve().weights.values.tobytes(),
        "job": lambda: job.result().weights.values.tobytes(),
    }
    if refiner:
        calls["refine"] = lambda: refiner.solve(turned).tobytes()
    expected = {name: call() for name, call in calls.items() if name != "job"}
    heard, problems = {}, []

    def work(name):
        try:
            heard.setdefault(name, set()).add(calls[name]())
        except BaseException as error:
            problems.append(f"{name}: {type(error).__name__}: {error}")

    workers = [threading.Thread(target=work, args=(name,)) for name in calls for _ in range(3)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert not problems, problems
    assert all(len(answers) == 1 for answers in heard.values())
    assert all(heard[name] == {answer} for name, answer in expected.items())


def forked(rng):
    """A child process goes on with the module and objects that its parent has used."""
    if not hasattr(os, "fork"):
        return
    positions, triangles, _, _, dense = character(rng)
    source = native.Source(positions, triangles, rows_of(dense))
    count = int(rng.integers(3))
    before = source.transfer(positions, triangles, threads=count).weights.values.tobytes()
    child = os.fork()
    if child == 0:
        signal.alarm(30)
        os._exit(0 if source.transfer(positions, triangles, threads=count).weights.values.tobytes() == before else 1)
    assert os.waitpid(child, 0)[1] == 0, "the child hangs or has other weights"


CALLS = [automatic, embed, retarget, refine, skinning, fill, threads, forked]
