"""A small version of the study of the watch: 23 mornings to learn from, and a sudden loss of stiffness."""

import pytest
import watch_mornings

from dovetail.monitoring import WatchOptions


@pytest.mark.slow
def test_a_sudden_loss_is_noticed_at_once_and_walk_and_drift_are_not(tmp_path, monkeypatch):
    monkeypatch.setattr(watch_mornings, "OPTIONS", WatchOptions(reference=23))
    monkeypatch.setattr(watch_mornings, "MOST_FILES", 2)
    mornings = watch_mornings.Mornings(27, [7])
    mornings.write_all(tmp_path / "files")
    run = watch_mornings.watched(tmp_path, mornings, 1)
    assert run.judged == 4
    assert run.false_alarms == []
    assert run.delays["10 % at once"] == [1]
