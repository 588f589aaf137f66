"""Reducers and the perceptron against their definitions written out, beyond one block of rows and at their limits."""

from __future__ import annotations

import numpy as np
import pytest

import dovetail
from dovetail_plugins.arrays import checked_rows, state_array, state_number
from dovetail_plugins.reducers.compression import Compression
from dovetail_plugins.reducers.neighbours import Neighbours, membership_strengths
from dovetail_plugins.reducers.pca import PCA
from dovetail_plugins.reducers.umap import UMAP
from dovetail_plugins.regressors.mlp import MLP


def random_rows(count: int, width: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((count, width)).astype(np.float32)


def test_principal_components_of_more_rows_than_a_block():
    """Each coordinate is a product with a component, the mean of the training rows taken away before."""
    training = random_rows(300, 6) * np.array([9, 5, 3, 2, 1, 0.5], dtype=np.float32) + 4.0
    fitted = PCA(PCA.Config(n_components=3)).fit(training, seed=0)
    state = fitted.state()
    many = np.concatenate([training] * 9)  # 2700 rows
    expected = (many.astype(float) - training.mean(axis=0, dtype=float)) @ state["components"].T.astype(float)
    np.testing.assert_allclose(fitted.transform(many), expected, atol=2e-5)
    np.testing.assert_allclose(state["components"] @ state["components"].T, np.eye(3), atol=1e-6)
    directions = np.linalg.svd(training - training.mean(axis=0), full_matrices=False)[2][:3]
    np.testing.assert_allclose(np.abs(np.sum(directions * state["components"], axis=1)), 1.0, atol=1e-5)


def test_as_many_components_as_samples_or_features_and_not_one_more():
    assert PCA(PCA.Config(n_components=6)).fit(random_rows(20, 6), seed=0).transform(random_rows(2, 6)).shape == (2, 6)
    assert PCA(PCA.Config(n_components=5)).fit(random_rows(5, 9), seed=0).transform(random_rows(2, 9)).shape == (2, 5)
    with pytest.raises(dovetail.DovetailError) as caught:
        PCA(PCA.Config(n_components=7)).fit(random_rows(20, 6), seed=0)
    assert "1 to 6" in str(caught.value)


def distance(first, second, metric):
    """Of two rows, by the definitions."""
    if metric == "euclidean":
        return np.linalg.norm(first - second)
    if metric == "correlation":
        first, second = first - first.mean(), second - second.mean()
    return 1.0 - first @ second / (np.linalg.norm(first) * np.linalg.norm(second))


@pytest.mark.parametrize("metric", ["correlation", "cosine", "euclidean"])
def test_compressed_rows_keep_the_distances_of_the_metric(metric):
    """With all directions kept, to single precision; in two blocks."""
    training = random_rows(1100, 5) + np.arange(5, dtype=np.float32)
    compression = Compression.fit(training, metric, fewest=5, seed=0)
    axes = compression.directions
    assert len(axes) == 5
    np.testing.assert_allclose(axes @ axes.T, np.eye(5), atol=1e-5)
    rows = compression.project(training)
    assert rows.dtype == np.float32
    for first, second in ((0, 1), (5, 1050), (1030, 1099)):
        square = np.sum((rows[first].astype(float) - rows[second]) ** 2)
        expected = distance(training[first].astype(float), training[second].astype(float), metric)
        assert compression.distances(np.array([square]))[0] == pytest.approx(expected, rel=1e-4)


def test_few_directions_hold_nearly_all_variance():
    """Three of twenty carry all but a millionth of it; ten are kept where ten are asked for."""
    strong = random_rows(400, 3) @ random_rows(3, 20, seed=1) + 1e-4 * random_rows(400, 20, seed=2)
    assert len(Compression.fit(strong, "euclidean", fewest=1, seed=0).directions) == 3
    assert len(Compression.fit(strong, "euclidean", fewest=10, seed=0).directions) == 10
    assert len(Compression.fit(strong, "euclidean", fewest=99, seed=0).directions) == 20


def test_rows_of_length_zero_are_accepted():
    rows = np.vstack([np.zeros(4), np.full(4, 3.0), random_rows(30, 4)]).astype(np.float32)
    for metric in ("correlation", "cosine", "euclidean"):
        assert np.isfinite(Compression.fit(rows, metric, fewest=2, seed=0).project(rows)).all()


@pytest.mark.parametrize(("spread", "count"), [(1.0, 400), (1e-5, 400), (1.0, 3011), (1e-5, 3011)])
def test_nearest_neighbours_are_exact_beyond_single_precision(spread, count):
    """Also of rows that are ranked in groups, of which some are left."""
    rows = 1.0 + spread * np.random.default_rng(0).standard_normal((count, 6))
    points = rows[:300] + 0.1 * spread
    squares = np.sum((rows - points[:, np.newaxis]) ** 2, axis=2)
    wanted = np.argsort(squares, axis=1, kind="stable")[:, :5]
    indices, found = Neighbours(rows).nearest(points, 5)
    np.testing.assert_array_equal(indices, wanted)
    np.testing.assert_allclose(found, np.take_along_axis(squares, wanted, axis=1), rtol=1e-12)


def test_the_nearest_of_more_points_than_a_block_and_of_few_rows():
    rows, points = random_rows(11, 3), random_rows(600, 3, seed=1)
    indices, squares = Neighbours(rows).nearest(points, 4)
    truth = ((points[:, None].astype(float) - rows) ** 2).sum(axis=2)
    np.testing.assert_array_equal(indices, np.argsort(truth, axis=1)[:, :4])
    np.testing.assert_allclose(squares, np.sort(truth, axis=1)[:, :4], rtol=1e-12)
    everyone, _ = Neighbours(rows).nearest(points[:2], 11)
    assert np.sort(everyone, axis=1).tolist() == [list(range(11))] * 2


def test_membership_strengths_by_their_definition():
    """exp(-d / sigma), those of all but the nearest adding up to log2 of the number of neighbours."""
    distances = np.array([[0.0, 1.0, 1.0, 2.0, 3.0, 7.0, 7.5, 8.0], [0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 50.0]])
    strengths = membership_strengths(distances)
    np.testing.assert_allclose(strengths[:, 1:].sum(axis=1), 3.0, rtol=1e-9)
    sigma = -distances[:, 3] / np.log(strengths[:, 3])
    np.testing.assert_allclose(strengths, np.exp(-distances / sigma[:, None]), rtol=1e-9)
    far = membership_strengths(np.array([[0.0, 0.0, 0.0, 1.0]]))  # the two at no distance are enough: sigma is least
    assert far[0].tolist() == pytest.approx([1.0, 1.0, 1.0, np.exp(-1.0 / (1e-3 * 0.25))], abs=1e-12)


def test_umap_places_a_row_at_the_weighted_mean_of_its_neighbours():
    """Four stored rows on a line, two neighbours: both strengths are 1, since the second alone adds up to log2(2)."""
    state = {
        "metric": "euclidean",
        "n_neighbors": 2,
        "mean": np.array([10.0, 0.0], dtype=np.float32),
        "directions": np.array([[1.0, 0.0]], dtype=np.float32),
        "unit": 2.0,
        "rows": np.array([[0.0], [1.0], [2.0], [3.0]], dtype=np.float16),
        "embedding": np.array([[0.0, 1.0], [4.0, 1.0], [8.0, 3.0], [100.0, -7.0]], dtype=np.float32),
    }
    fitted = UMAP().restore(state)
    points = np.array([[12.4, 5.0], [9.0, -3.0]], dtype=np.float32)  # 2.4 and -1 along the line; rows at 0, 2, 4, 6
    strengths = membership_strengths(np.array([[0.4, 1.6], [1.0, 3.0]]))
    shares = strengths / strengths.sum(axis=1, keepdims=True)
    expected = [shares[0] @ state["embedding"][[1, 2]], shares[1] @ state["embedding"][[0, 1]]]
    np.testing.assert_allclose(fitted.transform(points), expected, rtol=1e-5)
    for neighbours, accepted in ((1, False), (2, True), (4, True), (5, False)):
        changed = {**state, "n_neighbors": neighbours}
        if accepted:
            assert UMAP().restore(changed).state()["n_neighbors"] == neighbours
        else:
            with pytest.raises(dovetail.DovetailError, match=f"has {neighbours} neighbours among 4 rows"):
                UMAP().restore(changed)


def test_the_training_of_the_perceptron_written_out():
    """Adam with L2, the rate halved after a third of the patience without progress, the best of all epochs kept."""
    torch = pytest.importorskip("torch")
    features, targets = random_rows(83, 3), random_rows(83, 2, seed=1).astype(np.float64)
    options = {"hidden": (7, 5), "dropout": 0.2, "weight_decay": 1e-3, "learning_rate": 0.03, "batch_size": 16}
    config = MLP.Config(**options, max_epochs=40, patience=9, validation_fraction=0.15)
    losses: list[float] = []
    fitted = MLP(config).fit(
        features, targets, seed=4, progress=lambda *call: losses.append(float(call[3].split()[-1]))
    )

    torch.manual_seed(4)
    inputs, outputs = torch.from_numpy(features), torch.from_numpy(targets.astype(np.float32))
    order = torch.randperm(83)
    held, training = order[:12], order[12:]  # 15 % of 83 is 12.45
    layers = [torch.nn.Linear(*size) for size in ((3, 7), (7, 5), (5, 2))]
    relu, dropout = torch.nn.ReLU(), torch.nn.Dropout(0.2)
    network = torch.nn.Sequential(layers[0], relu, dropout, layers[1], relu, dropout, layers[2])
    adam = torch.optim.Adam(network.parameters(), lr=0.03, weight_decay=1e-3, fused=True)
    loss_of = torch.nn.MSELoss()
    expected, best, unimproved, for_rate = [], None, 0, 0
    lowest = lowest_for_rate = np.inf
    while unimproved < 9 and len(expected) < 40:
        network.train()
        for batch in torch.split(training[torch.randperm(71)], 16):
            adam.zero_grad()
            loss_of(network(inputs[batch]), outputs[batch]).backward()
            adam.step()
        network.eval()
        current = float(loss_of(network(inputs[held]), outputs[held]).detach())
        for_rate = 0 if current < lowest_for_rate * (1 - 1e-4) else for_rate + 1
        lowest_for_rate = min(lowest_for_rate, current) if for_rate == 0 else lowest_for_rate
        if for_rate > 3:
            adam.param_groups[0]["lr"] /= 2
            for_rate = 0
        unimproved += 1
        if current < lowest:
            lowest, unimproved = current, 0
            best = [layer.weight.detach().numpy().T.copy() for layer in layers]
        expected.append(current)
    assert len(losses) == len(expected) < 40
    assert adam.param_groups[0]["lr"] < 0.03
    np.testing.assert_allclose(losses, expected, rtol=1e-4)
    for index, weight in enumerate(best):
        np.testing.assert_allclose(fitted.state()[f"weight{index}"], weight, rtol=1e-4, atol=1e-6)


def test_epochs_are_requested_once_and_in_order():
    asked: list[int] = []

    def epoch(number: int):
        asked.append(number)
        generator = np.random.default_rng(number)
        features = generator.standard_normal((40, 3)).astype(np.float32)
        return features, features[:, :1].astype(np.float64)

    reported: list[tuple] = []
    recipe = MLP(MLP.Config(hidden=(8, 4), max_epochs=4, batch_size=8))
    changing = recipe.fit_epochs(epoch, seed=0, progress=lambda *call: reported.append(call[:3]))
    assert asked == [0, 1, 2, 3]
    assert reported == [("regressor", number, 4) for number in (1, 2, 3, 4)]
    same = recipe.fit(*epoch(0), seed=0)
    assert not np.allclose(same.state()["weight0"], changing.state()["weight0"])
    once = MLP(MLP.Config(hidden=(8, 4), max_epochs=1, batch_size=8))
    np.testing.assert_array_equal(
        once.fit_epochs(epoch, seed=0).state()["weight0"], once.fit(*epoch(0), seed=0).state()["weight0"]
    )


def test_wrong_inputs_of_a_network_are_errors_with_its_name():
    fitted = MLP(MLP.Config(hidden=(4, 4), max_epochs=1)).fit(random_rows(9, 2), random_rows(9, 1), seed=0)
    with pytest.raises(dovetail.DovetailError, match="regressor 'mlp'\n  it was given 3 columns, but was fitted to 2"):
        fitted.predict(random_rows(5, 3))


def test_the_perceptron_can_be_trained_on_three_samples():
    """Three samples: one to validate with, two to train on, whatever the fraction."""
    for fraction in (0.01, 0.99):
        recipe = MLP(MLP.Config(hidden=(4, 4), max_epochs=2, validation_fraction=fraction))
        answer = recipe.fit(random_rows(3, 2), random_rows(3, 1).astype(float), seed=0).predict(random_rows(5, 2))
        assert answer.shape == (5, 1)


@pytest.mark.parametrize(
    ("values", "fault"),
    [
        (np.zeros(3), r"an array of float64 with shape \(3,\)"),
        (np.zeros((0, 3)), r"with shape \(0, 3\)"),
        (np.zeros((2, 3), dtype=complex), "an array of complex128"),
        (np.array([["a", "b", "c"]]), "an array of <U1"),
        (np.zeros((2, 4)), "it was given 4 columns, but was fitted to 3"),
        (np.array([[0.0, 1.0, 2.0], [0.0, 1.0, np.inf]]), "row 1, column 2 is inf"),
        (np.array([[np.nan, 1.0, 2.0], [0.0, 1.0, np.inf]]), "row 0, column 0 is nan"),
    ],
)
def test_a_table_is_finite_numbers_of_the_wanted_width(values, fault):
    with pytest.raises(dovetail.DovetailError, match=fault):
        checked_rows(values, "someone", width=3)


def test_rows_of_integers_are_accepted_as_numbers():
    assert checked_rows([[1, 2, 3]], "someone").tolist() == [[1, 2, 3]]
    assert checked_rows(np.ones((2, 2), dtype=np.uint8), "someone", width=2).shape == (2, 2)


def test_a_state_is_checked():
    state = {"mean": np.zeros((2, 3)), "text": "x", "bad": np.array([np.nan]), "count": 4}
    assert state_array(state, "mean", "someone", (None, 3)).shape == (2, 3)
    assert state_number(state, "count", "someone") == 4.0
    for key, shape, fault in (
        ("mean", (3, None), r"has 'mean' as float64 with shape \(2, 3\)\.\n.*shape \(3, any\)"),
        ("mean", (2,), r"has 'mean' as float64"),
        ("text", (), "has 'text' as <U1"),
        ("gone", (2,), "its state lacks 'gone'"),
        ("bad", (1,), "values in 'bad' that are not finite"),
    ):
        with pytest.raises(dovetail.DovetailError, match=fault):
            state_array(state, key, "someone", shape)
