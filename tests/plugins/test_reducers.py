"""Reducers: each FRF is reduced independently, also after loading, and close to the method they are named after."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import ValidationError
from safetensors.numpy import save_file
from scipy.spatial.distance import cdist
from threadpoolctl import threadpool_limits

import dovetail
from dovetail_plugins.reducers.compression import METRICS, Compression
from dovetail_plugins.reducers.neighbours import Neighbours, membership_strengths
from dovetail_plugins.reducers.none import NoReducer
from dovetail_plugins.reducers.pca import PCA
from dovetail_plugins.reducers.umap import UMAP

Features = NDArray[np.float32]

TRAINING = 400


def amplitudes(samples: int, seed: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Accelerance amplitudes of 1 kg on random springs and dampers, 200 lines up to 600 Hz, and k and c from 0 to 1."""
    parameters = np.random.default_rng(seed).random((samples, 2))
    stiffness, damping = (np.array([1e5, 1.0]) + parameters * np.array([9.9e6, 99.0])).T[:, :, np.newaxis]
    omega = 2.0 * np.pi * np.arange(3.0, 601.0, 3.0)
    return np.abs(omega**2 / (stiffness + 1j * omega * damping - omega**2)), parameters


def features(amplitude: NDArray[np.float64]) -> Features:
    return np.log10(np.abs(amplitude) + 1.0).astype(np.float32)


@pytest.fixture(scope="module")
def training() -> Features:
    return features(amplitudes(TRAINING, 0)[0])


@pytest.fixture(scope="module")
def test_rows() -> Features:
    return features(amplitudes(60, 1)[0])


RECIPES: dict[str, dovetail.Reducer] = {
    "umap": UMAP(UMAP.Config(n_components=5, metric="euclidean", n_epochs=50)),
    "umap correlation": UMAP(UMAP.Config(n_components=5, n_epochs=50)),
    "pca": PCA(PCA.Config(n_components=12)),
    "pca whitened": PCA(PCA.Config(n_components=12, whiten=True)),
    "none": NoReducer(),
}


@pytest.fixture(scope="module")
def fits(training: Features) -> dict[str, dovetail.FittedReducer]:
    return {name: recipe.fit(training, seed=0) for name, recipe in RECIPES.items()}


@pytest.fixture(params=list(RECIPES))
def case(request: pytest.FixtureRequest, fits: dict) -> tuple[dovetail.Reducer, dovetail.FittedReducer]:
    return RECIPES[request.param], fits[request.param]


class TestEveryReducer:
    def test_one_row_gives_the_same_result_in_any_batch(self, case, training, test_rows):
        _, fitted = case
        rows = np.concatenate([test_rows, training])
        together = fitted.transform(rows)
        assert together.dtype == np.float32
        alone = np.concatenate([fitted.transform(rows[i : i + 1]) for i in range(len(rows))])
        np.testing.assert_array_equal(alone, together)
        np.testing.assert_array_equal(fitted.transform(rows[::-1])[::-1], together)

    def test_a_new_process_gives_the_same_after_loading(self, case, test_rows, tmp_path):
        recipe, fitted = case
        state = fitted.state()
        save_file({k: v for k, v in state.items() if isinstance(v, np.ndarray)}, tmp_path / "state.safetensors")
        plain = {k: v for k, v in state.items() if not isinstance(v, np.ndarray)}
        (tmp_path / "state.json").write_text(json.dumps(plain))
        np.save(tmp_path / "rows.npy", test_rows)
        script = f"""
import json, sys
import numpy as np
from safetensors.numpy import load_file
from {type(recipe).__module__} import {type(recipe).__name__} as Model
state = load_file("state.safetensors") | json.load(open("state.json"))
fitted = Model(Model.Config(**{recipe.config.model_dump()!r})).restore(state)
np.save("answer.npy", fitted.transform(np.load("rows.npy")))
print(*{{"torch", "umap", "numba", "sklearn"}} & set(sys.modules))
"""
        done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=True)
        assert done.stdout.split() == []
        np.testing.assert_array_equal(np.load(tmp_path / "answer.npy"), fitted.transform(test_rows))

    def test_state_is_arrays_and_plain_values(self, case):
        for value in case[1].state().values():
            assert type(value) in (int, float, str, bool) or (
                isinstance(value, np.ndarray) and value.dtype.kind in "fiu"
            )

    def test_changing_the_state_or_the_input_afterwards_changes_nothing(self, case, test_rows):
        _, fitted = case
        before = fitted.transform(test_rows)
        for value in fitted.state().values():
            if isinstance(value, np.ndarray):
                value[...] = 0
        rows = test_rows.copy()
        fitted.transform(rows)[...] = 0.0
        np.testing.assert_array_equal(rows, test_rows)
        np.testing.assert_array_equal(fitted.transform(test_rows), before)
        assert all(np.any(value) for value in fitted.state().values())

    def test_the_same_seed_gives_the_same_and_leaves_the_callers_random_numbers_alone(self, case, training, test_rows):
        recipe, fitted = case
        np.random.seed(5)  # noqa: NPY002
        before = np.random.get_state()[1].copy()  # noqa: NPY002
        again = recipe.fit(training, seed=0)
        np.testing.assert_array_equal(np.random.get_state()[1], before)  # noqa: NPY002
        np.testing.assert_array_equal(again.transform(test_rows), fitted.transform(test_rows))

    @pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
    def test_values_that_are_not_finite_are_refused(self, case, training, test_rows, value):
        recipe, fitted = case
        rows = test_rows.copy()
        rows[7, 11] = value
        with pytest.raises(dovetail.DovetailError, match=r"row 7, column 11 is -?(nan|inf), which is not finite"):
            fitted.transform(rows)
        training = training.copy()
        training[7, 11] = value
        with pytest.raises(dovetail.DovetailError, match=r"row 7, column 11"):
            recipe.fit(training, seed=0)

    def test_another_width_is_refused(self, case, test_rows):
        with pytest.raises(dovetail.DovetailError, match=r"given 199 columns, but was fitted to 200"):
            case[1].transform(test_rows[:, :-1])

    @pytest.mark.parametrize("shape", [(200,), (0, 200), (3, 0), (2, 3, 200)])
    def test_other_files_are_refused_as_tables(self, case, shape):
        with pytest.raises(dovetail.DovetailError, match="with shape"):
            case[1].transform(np.zeros(shape, dtype=np.float32))

    def test_a_state_that_lacks_something_is_refused(self, case):
        recipe, fitted = case
        assert fitted.state()
        for missing in fitted.state():
            state = {key: value for key, value in fitted.state().items() if key != missing}
            with pytest.raises(dovetail.DovetailError, match=f"{recipe.name}"):
                recipe.restore(state)


@pytest.fixture(scope="module")
def ours(training):
    return UMAP(UMAP.Config(n_components=5, metric="euclidean")).fit(training, seed=0)


def told_stiffness(training, test_rows, embedding, transform):
    """How well stiffness can be read off the places of unseen rows, as R2."""
    stiffness, wanted = amplitudes(TRAINING, 0)[1][:, 0], amplitudes(60, 1)[1][:, 0]
    return _r2(_nearest_mean(embedding, stiffness, transform(test_rows)), wanted)


def kept_neighbours(training, test_rows, embedding, transform):
    """The share of an unseen row's neighbours that are so among the places too."""
    truth = np.argsort(cdist(test_rows, training), axis=1)[:, :15]
    return _agreement(cdist(transform(test_rows), embedding), truth)


class TestUMAP:
    def test_stiffness_can_be_read_off_the_embedding_and_neighbours_stay(self, ours, training, test_rows):
        places = training, test_rows, ours.transform(training), ours.transform
        assert told_stiffness(*places) > 0.98
        assert kept_neighbours(*places) > 0.5

    @pytest.mark.slow  # umap-learn's own transform takes 15 s to be compiled
    def test_umap_keeps_stiffness_and_neighbours_as_well_as_umap_learn(self, ours, training, test_rows):
        umap = pytest.importorskip("umap")
        theirs = umap.UMAP(n_components=5, metric="euclidean", random_state=0, n_jobs=1).fit(training)
        our_places = training, test_rows, ours.transform(training), ours.transform
        their_places = training, test_rows, theirs.embedding_, theirs.transform
        assert told_stiffness(*our_places) > told_stiffness(*their_places) - 0.01
        assert kept_neighbours(*our_places) > kept_neighbours(*their_places) - 0.05

    def test_compiled_code_is_cached_for_the_next_process(self, fits):
        umap_, layouts = pytest.importorskip("umap.umap_"), pytest.importorskip("umap.layouts")
        for function in (umap_.smooth_knn_dist, layouts._nb_optimize_layout_euclidean_single_epoch):
            assert function.stats.cache_path is not None

    def test_a_training_frf_comes_near_the_place_of_the_layout(self, fits, training):
        embedding = fits["umap"].state()["embedding"]
        moved = np.linalg.norm(fits["umap"].transform(training) - embedding, axis=1)
        spread = np.linalg.norm(embedding - embedding.mean(axis=0), axis=1)
        assert np.median(moved) < 0.1 * np.median(spread)

    def test_noise_moves_stiffness_little(self, fits, training):
        stiffness = amplitudes(TRAINING, 0)[1][:, 0]
        amplitude, wanted = amplitudes(60, 1)
        noise = 0.2 * amplitude.std() * np.random.default_rng(2).standard_normal(amplitude.shape)
        fitted, reduced = fits["umap"], fits["umap"].transform(training)
        clean = _r2(_nearest_mean(reduced, stiffness, fitted.transform(features(amplitude))), wanted[:, 0])
        noisy = _r2(_nearest_mean(reduced, stiffness, fitted.transform(features(amplitude + noise))), wanted[:, 0])
        assert noisy > clean - 0.02

    def test_another_seed_gives_another_layout(self, fits, training):
        other = RECIPES["umap"].fit(training, seed=1)
        assert not np.allclose(other.state()["embedding"], fits["umap"].state()["embedding"])

    def test_a_stored_frf_takes_two_bytes_a_direction(self, fits):
        rows = fits["umap"].state()["rows"]
        assert rows.dtype == np.float16
        assert rows.shape[1] < 100

    def test_too_few_samples_are_refused(self, training):
        with pytest.raises(
            dovetail.DovetailError, match=r"101 samples are too few for 15 neighbours and 100 components"
        ):
            UMAP().fit(training[:101], seed=0)

    @pytest.mark.parametrize(("neighbours", "components", "fewest"), [(7, 3, 9), (3, 6, 8)])
    def test_it_is_fitted_to_the_fewest_samples_and_refuses_fewer(self, neighbours, components, fewest):
        rows = np.random.default_rng(0).standard_normal((fewest, 12)).astype(np.float32)
        recipe = UMAP(UMAP.Config(n_components=components, n_neighbors=neighbours, n_epochs=5, metric="euclidean"))
        assert recipe.fit(rows, seed=0).transform(rows[:2]).shape == (2, components)
        with pytest.raises(dovetail.DovetailError, match=f"{fewest - 1} samples are too few"):
            recipe.fit(rows[1:], seed=0)

    def test_rows_that_are_all_the_same_are_refused(self, training):
        with pytest.raises(dovetail.DovetailError, match="all training rows are the same"):
            RECIPES["umap"].fit(np.repeat(training[:1], 50, axis=0), seed=0)

    def test_an_unknown_metric_in_a_state_is_refused(self, fits):
        with pytest.raises(dovetail.DovetailError, match=r"metric 'manhattan'.*\n.*correlation"):
            UMAP().restore({**fits["umap"].state(), "metric": "manhattan"})

    @pytest.mark.parametrize("key", ["rows", "embedding", "mean"])
    def test_inconsistent_state_arrays_are_refused(self, fits, key):
        state = dict(fits["umap"].state())
        state[key] = state[key][..., :-1] if key == "rows" else state[key][:-1]
        with pytest.raises(dovetail.DovetailError, match="its state has"):
            UMAP().restore(state)

    @pytest.mark.parametrize(
        "options", [{"metric": "manhattan"}, {"n_neighbors": 1}, {"n_components": 0}, {"neighbors": 5}]
    )
    def test_options_out_of_bounds_are_refused(self, options):
        with pytest.raises(ValidationError):
            UMAP.Config(**options)


class TestNeighbours:
    def test_nearest_neighbours_are_exact_among_nearly_equal_rows(self, training):
        rows = np.concatenate([training, training + np.float32(1e-4)])
        indices, squares = Neighbours(rows).nearest(training, 15)
        distances = cdist(training, rows, "sqeuclidean")
        np.testing.assert_allclose(squares, np.sort(distances, axis=1)[:, :15], rtol=1e-12, atol=1e-18)
        np.testing.assert_allclose(np.take_along_axis(distances, indices, axis=1), squares, rtol=1e-12, atol=1e-18)

    def test_neighbours_hidden_by_rounding_are_found(self):
        near = 1e6 + 1e-5 * np.arange(23.0)[::-1, np.newaxis] * np.ones((1, 3))
        indices, _ = Neighbours(np.concatenate([near, near + 1.0])).nearest(near[22:], 15)
        np.testing.assert_array_equal(indices, [np.arange(22, 7, -1)])

    def test_strengths_of_neighbours_equal_those_of_umap_learn(self, training, test_rows):
        umap_ = pytest.importorskip("umap.umap_")
        distances = np.sort(cdist(test_rows, training), axis=1)[:, :15]
        sigma, rho = umap_.smooth_knn_dist(distances.astype(np.float32), 15.0, local_connectivity=0.0)
        indices = np.tile(np.arange(15, dtype=np.int32), (len(distances), 1))
        wanted = umap_.compute_membership_strengths(indices, distances.astype(np.float32), sigma, rho, bipartite=True)[
            2
        ]
        np.testing.assert_allclose(membership_strengths(distances), wanted.reshape(distances.shape), atol=1e-4)

    def test_strengths_of_a_point_do_not_depend_on_other_points(self):
        distances = np.array([[0.0] * 14 + [1e-3], [1.0] * 15])
        np.testing.assert_array_equal(membership_strengths(distances)[:1], membership_strengths(distances[:1]))

    def test_neighbours_at_zero_distance_have_equal_weights(self):
        np.testing.assert_array_equal(membership_strengths(np.zeros((1, 5))), np.ones((1, 5)))

    @pytest.mark.parametrize("metric", METRICS)
    def test_compression_keeps_the_neighbours(self, training, metric):
        compression = Compression.fit(training, metric, fewest=2, seed=0)
        rows = compression.project(training)
        assert rows.shape[1] < training.shape[1]
        wanted = np.argsort(cdist(training, training, metric), axis=1)[:, :15]
        indices, squares = Neighbours(rows).nearest(rows, 15)
        kept = np.mean([len(set(a) & set(b)) / 15 for a, b in zip(indices, wanted, strict=True)])
        assert kept > 0.95
        exact = np.take_along_axis(cdist(training, training, metric), indices, axis=1)
        np.testing.assert_allclose(compression.distances(squares)[:, 8:], exact[:, 8:], rtol=0.15)


class TestPCA:
    def test_components_are_those_of_the_singular_value_decomposition(self, fits, training, test_rows):
        mean = training.mean(axis=0, dtype=np.float64)
        directions = np.linalg.svd(training - mean, full_matrices=False)[2][:6]
        wanted = np.abs((test_rows - mean) @ directions.T)
        np.testing.assert_allclose(np.abs(fits["pca"].transform(test_rows)[:, :6]), wanted, atol=2e-3)

    def test_signs_do_not_depend_on_the_order_of_the_samples(self, fits, training, test_rows):
        other = RECIPES["pca"].fit(training[::-1], seed=1)
        first, second = other.transform(test_rows)[:, :6], fits["pca"].transform(test_rows)[:, :6]
        np.testing.assert_allclose(first, second, atol=5e-3)

    def test_whitened_components_have_unit_variance(self, fits, training):
        np.testing.assert_allclose(fits["pca whitened"].transform(training).std(axis=0, ddof=1), 1.0, rtol=1e-3)

    def test_components_do_not_depend_on_the_number_of_threads(self):
        rows = np.random.default_rng(0).standard_normal((4000, 300)).astype(np.float32)
        states = []
        for threads in (1, 2):
            with threadpool_limits(threads, user_api="blas"):
                states.append(RECIPES["pca"].fit(rows, seed=0).state()["components"])
        np.testing.assert_array_equal(*states)

    def test_more_components_than_can_be_had_are_refused(self, training):
        with pytest.raises(
            dovetail.DovetailError, match=r"100 components cannot be had from 50 samples of 200 features"
        ):
            PCA().fit(training[:50], seed=0)

    def test_rows_that_are_all_the_same_stay_finite(self, training):
        same = np.repeat(training[:1], 50, axis=0)
        recipe = PCA(PCA.Config(n_components=3, whiten=True))
        assert np.isfinite(recipe.fit(same, seed=0).transform(training)).all()


class TestNoReducer:
    def test_features_pass_unchanged(self, fits, test_rows):
        np.testing.assert_array_equal(fits["none"].transform(test_rows), test_rows)


def test_importing_the_reducers_loads_nothing_heavy():
    script = """
import sys
import dovetail_plugins.reducers.none, dovetail_plugins.reducers.pca, dovetail_plugins.reducers.umap
print(*{"torch", "umap", "numba", "sklearn"} & set(sys.modules))
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def _nearest_mean(reduced: Features, values: NDArray[np.float64], points: Features) -> NDArray[np.float64]:
    """Mean of the values of the five nearest points of the embedding: a regression that learns nothing else."""
    return values[np.argsort(cdist(points, reduced), axis=1)[:, :5]].mean(axis=1)


def _r2(predicted: NDArray[np.float64], wanted: NDArray[np.float64]) -> float:
    return float(1.0 - ((predicted - wanted) ** 2).sum() / ((wanted - wanted.mean()) ** 2).sum())


def _agreement(distances: NDArray[np.float64], truth: NDArray[np.intp]) -> float:
    """Share of the 15 true neighbours that are among the 15 nearest of the embedding."""
    found = np.argsort(distances, axis=1)[:, :15]
    return float(np.mean([len(set(a) & set(b)) / 15 for a, b in zip(found, truth, strict=True)]))
