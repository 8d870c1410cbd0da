"""Policies as files: what is written is what is read, and what does not fit is refused with what differs."""

import contextlib
import json
import os
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_learned import LEARNER, network

from tral_env import policy_file, tensors
from tral_env.errors import ConfigError, PolicyFileError
from tral_env.interface import CORE_LAYOUT
from tral_env.learned import LearnedPolicy, Network
from tral_env.learner import LearnerConfig, LearnerView


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    net = network(provenance={"algorithm": "by hand", "curve": [{"seconds": 1.0}]})
    policy_file.save(net, tmp_path / "policy")
    return tmp_path / "policy"


def change(folder: Path, **parts: Any) -> None:
    path = folder / "policy.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | parts))


def content(folder: Path, part: str) -> dict[str, Any]:
    return json.loads((folder / "policy.json").read_text())[part]


@pytest.mark.parametrize("path", ["policy", "policy/policy.json"])
def test_what_is_written_is_read(folder: Path, path: str) -> None:
    read, written = policy_file.load(folder.parent / path).network, network()
    assert read.learner == LEARNER
    assert (read.activation, read.output, read.normalization) == ("relu", "clip", None)
    assert read.provenance == {"algorithm": "by hand", "curve": [{"seconds": 1.0}]}
    for ours, theirs in zip(written.layers, read.layers, strict=True):
        assert all(np.array_equal(a, b) for a, b in zip(ours, theirs, strict=True))


def test_normalization_is_written_too(tmp_path: Path) -> None:
    size = network().layers[0][0].shape[1]
    normalization = (np.arange(size, dtype=np.float32), np.full(size, 2.0, np.float32))
    policy_file.save(network(normalization=normalization), tmp_path)
    read = policy_file.load(tmp_path).network.normalization
    assert read is not None
    assert [part.tolist() for part in read] == [part.tolist() for part in normalization]


def test_it_says_what_it_sees_and_what_its_answers_mean(folder: Path) -> None:
    assert [each[0] for each in content(folder, "observation")["fields"]] == list(CORE_LAYOUT.names)
    assert content(folder, "learner")["action"] == "speed"
    assert content(folder, "learner")["drive_range"] == [0.2, 1.0]
    assert content(folder, "network")["sizes"] == [112, 16, 2]


def test_it_names_what_is_remembered_behind_the_columns_of_a_frame(tmp_path: Path) -> None:
    learner = LearnerConfig(observation="features", history=2, memory=True)
    view = LearnerView(learner, 1)
    layers = [(np.zeros((2, view.size), np.float32), np.zeros(2, np.float32))]
    policy_file.save(Network(learner=learner, layers=layers), tmp_path)
    assert content(tmp_path, "observation")["frame"] == [*view.frame_names, *view.memory_names]
    assert policy_file.load_network(tmp_path).learner == learner


def test_a_file_from_before_there_was_a_memory_has_none(folder: Path) -> None:
    path = folder / "policy.json"
    written = json.loads(path.read_text())
    del written["learner"]["memory"]
    path.write_text(json.dumps(written))
    assert policy_file.load_network(folder).learner.memory is False


def test_a_read_policy_drives_as_the_written_one(folder: Path) -> None:
    read, written = policy_file.load(folder), LearnedPolicy(network())
    readings = CORE_LAYOUT.missing(1)[0].astype(np.float32)
    assert read.act(readings).tolist() == written.act(readings).tolist()


def test_a_policy_file_is_known_by_its_content(folder: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.json"
    other.write_text('{"name": "corners"}')
    assert [policy_file.is_policy_file(path) for path in (folder, folder / "policy.json", other, "corners")] == [
        True, True, False, False,
    ]  # fmt: skip


class TestSaving:
    def test_what_cannot_be_written_leaves_the_older_policy(self, folder: Path) -> None:
        with pytest.raises(ConfigError, match="provenance"):
            policy_file.save(network(seed=1, provenance={"loss": float("inf")}), folder)
        with pytest.raises(ConfigError, match=r"policy.json would have \d+ bytes: expected 1048576 at most"):
            policy_file.save(network(seed=1, provenance={"curve": "x" * 2**20}), folder)
        assert np.array_equal(policy_file.load(folder).network.layers[0][0], network().layers[0][0])

    def test_a_stop_between_the_two_files_leaves_the_older_policy(
        self, folder: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def stop_at_json(path: Path, content: bytes) -> None:
            if path.name == "policy.json":
                raise KeyboardInterrupt
            path.write_bytes(content)

        for seed in (1, 2):
            with monkeypatch.context() as patch:
                patch.setattr(policy_file, "write_bytes", stop_at_json)
                with pytest.raises(KeyboardInterrupt):
                    policy_file.save(network(seed=seed), folder)
            assert np.array_equal(policy_file.load(folder).network.layers[0][0], network().layers[0][0])
        policy_file.save(network(seed=3), folder)
        assert np.array_equal(policy_file.load(folder).network.layers[0][0], network(seed=3).layers[0][0])
        assert sorted(path.name for path in folder.iterdir()) == ["policy.json", "policy.safetensors"]


class TestRefusals:
    @pytest.mark.parametrize("name", ["policy.json", "policy.safetensors"])
    def test_a_pipe_or_a_device(self, folder: Path, name: str) -> None:
        for make in (os.mkfifo, lambda path: Path(path).symlink_to("/dev/zero")):
            (folder / name).unlink()
            make(folder / name)
            with pytest.raises(PolicyFileError, match=f"{name}: cannot be read: it is no file"):
                policy_file.load_network(folder / "policy.json")

    @pytest.mark.parametrize(
        ("part", "values", "message"),
        [
            ("observation", {"schema": "-", "fields": 5}, "expected fields, a list of lists"),
            ("observation", {"schema": "-", "fields": [[[1], 2]]}, "expected fields, a list of lists"),
            ("observation", {"frame": 5}, "expected frame, a list of names"),
            ("learner", {"decision_hz": 10**400}, "learner: decision_hz"),
            ("network", {"sizes": "abc"}, "expected sizes, a list"),
            ("network", {"sizes": ["x", -5, 1e9]}, "sizes .*: the weights have"),
            ("network", {"sizes": [112, 2]}, "belongs to no layer"),
            ("network", {"normalized": "no"}, "normalized, true or false"),
        ],
    )
    def test_values_of_another_kind(self, folder: Path, part: str, values: dict, message: str) -> None:
        change(folder, **{part: content(folder, part) | values})
        self.refused(folder, message)

    def test_a_name_that_stands_twice(self, folder: Path) -> None:
        path = folder / "policy.json"
        path.write_text(path.read_text().replace('"version": 1,', '"version": 1, "version": 1,'))
        self.refused(folder, "/version: is there more than once")

    def refused(self, folder: Path, message: str) -> None:
        with pytest.raises(PolicyFileError, match=message):
            policy_file.load(folder)

    def test_a_field_that_is_unknown_here(self, folder: Path) -> None:
        about = content(folder, "observation")
        change(folder, observation=about | {"schema": "-", "fields": [*about["fields"], ["lidar", "m", 0, 9, 9]]})
        self.refused(folder, "policy.json: made for other readings: 'lidar' is unknown here: train it anew")

    def test_a_field_that_it_does_not_know(self, folder: Path) -> None:
        about = content(folder, "observation")
        fields = [each for each in about["fields"] if each[0] != "speed"]
        change(folder, observation=about | {"schema": "-", "fields": fields})
        self.refused(folder, "it has no 'speed'")

    def test_a_field_with_other_bounds(self, folder: Path) -> None:
        about = content(folder, "observation")
        fields = [[*each[:3], 4.0, 4.0] if each[0] == "ultrasonic_left" else each for each in about["fields"]]
        change(folder, observation=about | {"schema": "-", "fields": fields})
        self.refused(folder, r"'ultrasonic_left' is \['m', 0.0, 4.0, 4.0\] there and \['m', 0.0, 6.0, 6.0\] here")

    def test_fields_in_another_order(self, folder: Path) -> None:
        about = content(folder, "observation")
        change(folder, observation=about | {"schema": "-", "fields": about["fields"][::-1]})
        self.refused(folder, "the fields come in another order")

    def test_other_features(self, folder: Path) -> None:
        about = content(folder, "observation")
        change(folder, observation=about | {"frame": [*about["frame"][1:], "bearing"]})
        self.refused(folder, "made for other features: it lacks left_range, and has beside them bearing")

    @pytest.mark.parametrize(
        ("parts", "message"),
        [
            ({"format": "onnx"}, 'no policy: expected an object with "format": "tral-policy"'),
            ({"version": 2}, "version 2: this program reads version 1"),
            ({"learner": 3}, "learner: expected an object"),
            ({"learner": {"decision_hz": 30}}, "learner: decision_hz = 30: a decision would take"),
            ({"learner": {"history": "4"}}, "learner: history = '4'"),
            ({"network": {}}, "not the weights"),
        ],
    )
    def test_another_content(self, folder: Path, parts: dict, message: str) -> None:
        change(folder, **parts)
        self.refused(folder, message)

    def test_a_missing_part(self, folder: Path) -> None:
        whole = json.loads((folder / "policy.json").read_text())
        del whole["learner"]
        (folder / "policy.json").write_text(json.dumps(whole))
        self.refused(folder, "'learner' is missing: expected format, version")

    def test_layers_that_do_not_fit(self, folder: Path) -> None:
        change(folder, network=content(folder, "network") | {"sizes": [112, 16, 16, 2]})
        self.refused(folder, "network: 'layer2.weight' is missing")

    def test_the_weights_of_another_policy(self, folder: Path, tmp_path: Path) -> None:
        policy_file.save(network(seed=1), tmp_path / "other")
        (tmp_path / "other" / "policy.safetensors").replace(folder / "policy.safetensors")
        self.refused(folder, "these are not the weights of .*policy.json: copy both files together")

    def test_missing_weights(self, folder: Path) -> None:
        (folder / "policy.safetensors").unlink()
        self.refused(folder, "it belongs beside policy.json")

    def test_no_json(self, folder: Path) -> None:
        (folder / "policy.json").write_text("{,}")
        self.refused(folder, r"policy\.json:1:2: not JSON: Expecting property name")

    @pytest.mark.parametrize("number", ["NaN", "-Infinity", "1e999"])
    def test_numbers_that_no_json_has(self, folder: Path, number: str) -> None:
        path = folder / "policy.json"
        path.write_text(path.read_text().replace('"seconds": 1.0', f'"seconds": {number}'))
        self.refused(folder, "no JSON: Out of range float values")

    def test_a_file_that_runs_code_when_unpickled(self, folder: Path, tmp_path: Path) -> None:
        import pickle

        touched = tmp_path / "touched"

        class Evil:
            def __reduce__(self) -> Any:
                return Path.touch, (touched,)

        (folder / "policy.safetensors").write_bytes(pickle.dumps(Evil()))
        self.refused(folder, "no safetensors file")
        assert not touched.exists()


def raw(header: Any, data: bytes = b"") -> bytes:
    text = json.dumps(header).encode()
    return struct.pack("<Q", len(text)) + text + data


def entry(shape: list[Any], begin: Any, end: Any, dtype: str = "F32") -> dict[str, Any]:
    return {"dtype": dtype, "shape": shape, "data_offsets": [begin, end]}


class TestTensors:
    def test_the_format_by_hand(self) -> None:
        given = raw({"__metadata__": {"a": "b"}, "x": entry([2], 0, 8)}, struct.pack("<2f", 1.5, -2.0))
        assert {name: values.tolist() for name, values in tensors.loads(given, "x").items()} == {"x": [1.5, -2.0]}

    @given(st.lists(st.lists(st.integers(0, 4), max_size=3), max_size=4))
    def test_arrays_of_any_shape_come_back(self, shapes: list[list[int]]) -> None:
        rng = np.random.default_rng(0)
        arrays = {f"t{i}": rng.normal(size=shape).astype(np.float32) for i, shape in enumerate(shapes)}
        again = tensors.loads(tensors.dumps(arrays), "x")
        assert again.keys() == arrays.keys()
        assert all(np.array_equal(again[name], values) for name, values in arrays.items())
        assert all(again[name].shape == values.shape for name, values in arrays.items())

    @pytest.mark.parametrize(
        ("given", "message"),
        [
            (b"", "no safetensors file: its header would have 0 of 0 bytes"),
            (struct.pack("<Q", 2**60) + b"{}", "its header would have"),
            (struct.pack("<Q", 3) + b"{,}", "header:1:2: not JSON: Expecting property name"),
            (raw([1]), "its header is no JSON object"),
            (raw({"x": entry([2], 0, 8)}), "lies at 0 to 8 of 0 bytes"),
            (raw({"x": entry([2], 0, 4)}, b"\0" * 4), "lies at 0 to 4 of 4 bytes: expected 0 to 8"),
            (raw({"x": entry([1], 4, 8)}, b"\0" * 8), "lies at 4 to 8"),
            (raw({"x": entry([1], 0, 4), "y": entry([1], 0, 4)}, b"\0" * 4), "'y' .* lies at 0 to 4"),
            (raw({"x": entry([1], 0, 4)}, b"\0" * 8), "4 bytes behind the last tensor"),
            (raw({"x": entry([1], 0, 2, "F16")}, b"\0" * 2), "expected dtype F32"),
            (raw({"x": entry([-1], 0, 4)}, b"\0" * 4), "are no sizes"),
            (raw({"x": entry([2**40], 0, 4)}, b"\0" * 4), "are no sizes"),
            (raw({"x": entry([1], "0", 4)}, b"\0" * 4), "are no sizes"),
            (raw({"x": 3}), "expected dtype F32, shape and data_offsets"),
            (raw({"x": entry([1], 0, 4)}, struct.pack("<f", np.nan)), "'x' has numbers that are not finite"),
            (raw({"x": entry([1], 0, 4)}, struct.pack("<f", np.inf)), "not finite"),
        ],
    )
    def test_a_damaged_file_is_refused(self, given: bytes, message: str) -> None:
        with pytest.raises(PolicyFileError, match=message):
            tensors.loads(given, "w.safetensors")

    def test_a_file_that_is_too_large_is_refused(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(tensors, "MAX_BYTES", 10)
        with pytest.raises(PolicyFileError, match="expected 10 at most"):
            tensors.loads(b"\0" * 11, "w")

    @given(st.binary(max_size=80))
    def test_no_bytes_end_in_another_error(self, given: bytes) -> None:
        with contextlib.suppress(PolicyFileError):
            tensors.loads(given, "w")
