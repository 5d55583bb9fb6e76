"""Long recordings in pieces: put together they are what they are uncut."""

from __future__ import annotations

from pathlib import Path

import corsmal_feat as cf
import pytest
from test_arrow import write

pa = pytest.importorskip("pyarrow")

from corsmal_feat import _pieces  # noqa: E402
from corsmal_feat.arrow import extract_batch, join_pieces  # noqa: E402
from corsmal_feat.ray import manifest  # noqa: E402

FRAMES = """
[signal]
preemphasis = 0.97
[features.melspectrogram]
n_mels = 8
[features.rms]
hop_length = 300
"""


@pytest.fixture(scope="module")
def audio(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("audio")
    write(folder / "long.wav", 1, seconds=70_000 / 16_000, rate=16_000)
    write(folder / "short.wav", 2, rate=16_000)
    (folder / "text.wav").write_text("no audio at all")
    rows = ["path,id,start,end,type", "long.wav,whole,,,rice", "long.wav,part,0.25,3.9,rice"]
    rows += ["short.wav,short,,,water", "text.wav,text,,,water", "long.wav,beyond,0.5,99,rice"]
    (folder / "list.csv").write_text("\n".join(rows) + "\n")
    return folder


def test_pieces_put_together_are_the_recording(audio: Path):
    whole = manifest(audio / "list.csv")
    cut = manifest(audio / "list.csv", longest=1.0)
    assert cut["recording"].to_pylist() == ["whole"] * 5 + ["part"] * 4 + [
        "short",
        "text",
        "beyond",
    ]
    assert cut["id"].to_pylist()[:3] == ["whole@0.0", "whole@1.0", "whole@2.0"]
    # From the start of the recording, as those of `extract --window`.
    assert cut["id"].to_pylist()[5:8] == ["part@0.25", "part@1.25", "part@2.25"]
    assert cut["end_sample"].to_pylist()[:5] == [16000, 32000, 48000, 64000, None]
    expected = extract_batch(whole, config=FRAMES)
    found = join_pieces(extract_batch(cut, config=FRAMES))
    assert found.schema.equals(expected.schema, check_metadata=True)
    for name in expected.schema.names:
        assert found[name].to_pylist() == expected[name].to_pylist(), name
    assert expected["status"].to_pylist() == ["ok", "ok", "ok", "not_audio", "ok"]
    assert expected["repairs"].to_pylist()[4] == ["end_beyond_recording"]
    # Batches of any size are the same.
    some = [extract_batch(cut.slice(at, 3), config=FRAMES) for at in range(0, cut.num_rows, 3)]
    assert join_pieces(pa.concat_tables(some)).equals(found)


def test_what_has_no_pieces_is_refused(audio: Path):
    cut = manifest(audio / "list.csv", longest=1)
    for options, reason in [
        ({"preset": "mfcc-zcr"}, "leave out"),
        ({"config": {"features": {"mfcc": {}}}}, "maximum of the whole recording"),
        ({"config": {"features": {"cqt": {}}}}, "cqt is computed from the whole recording"),
    ]:
        with pytest.raises(cf.ParameterError, match=reason):
            extract_batch(cut, **options)
        with pytest.raises(cf.ParameterError, match=reason):
            cf.ray.extract(audio / "list.csv", audio / "out", longest=1, **options)
    assert not (audio / "out").exists()
    resampled = extract_batch(cut, config="[signal]\nsample_rate = 8000.0\n[features.rms]")
    assert resampled["status"].to_pylist()[0] == "unsupported"
    joined = join_pieces(resampled)
    assert joined["status"].to_pylist()[:2] == ["unsupported", "unsupported"]
    assert "resampled" in joined["reason"].to_pylist()[0]
    assert joined["rms"].to_pylist()[:2] == [None, None]


def test_pieces_that_are_not_all_there_are_not_put_together(audio: Path):
    found = extract_batch(manifest(audio / "list.csv", longest=1), config=FRAMES)
    for wrong in [found.slice(1), found.slice(0, 4), found.take([0, 2, 1, 3, 4])]:
        with pytest.raises(cf.ParameterError, match="missing or out of order"):
            join_pieces(wrong)
    with pytest.raises(cf.ParameterError, match="consecutive rows"):
        join_pieces(found.take([0, 9, 1]))
    with pytest.raises(cf.ParameterError, match="none of its recordings was cut"):
        join_pieces(extract_batch(manifest(audio / "list.csv"), config=FRAMES))
    for longest in (0, 0.05, -1, 3.1e8, float("nan"), float("inf")):
        with pytest.raises(cf.ParameterError, match=r"longest must be 0\.1 to 300000000"):
            manifest(audio / "list.csv", longest=longest)
    taken = pa.table({"path": ["x.wav"], "recording": ["x"]})
    with pytest.raises(cf.ParameterError, match="recording, but pieces need"):
        cf.ray.extract(taken, audio / "out", config=FRAMES, longest=1)


def test_recordings_without_a_frame_fail_as_they_do_uncut(audio: Path):
    whole, cut = manifest(audio / "long.wav"), manifest(audio / "long.wav", longest=1)
    for config, status in [
        ("[signal]\nstart = 20.0\n[features.rms]\n", "empty"),
        ('[features.stft]\ncenter = false\nn_fft = 131072\noutput = "power"\n', "too_short"),
    ]:
        expected = extract_batch(whole, config=config)
        found = join_pieces(extract_batch(cut, config=config))
        assert expected["status"].to_pylist() == found["status"].to_pylist() == [status]
        assert found.column(found.num_columns - 1).to_pylist() == [None]


def test_ids_and_times_that_no_piece_can_have(audio: Path):
    path = str(audio / "long.wav")
    twice = pa.table({"path": [path, path], "id": ["a", "a"], "start": [0.0, 1.0]})
    with pytest.raises(cf.ParameterError, match="the id 'a' more than once"):
        _pieces.cut(twice, 1.0)
    far = pa.table({"path": [path, path], "start": [1e308, None], "end": [None, 1e308]})
    ids = far.append_column("id", pa.array(["a", "b"]))
    assert _pieces.cut(ids, 1.0)["id"].to_pylist() == ["a", "b"]


def test_odd_headers_and_columns(audio: Path, tmp_path: Path):
    write(tmp_path / "slow.wav", 3, seconds=50, rate=2)
    assert manifest(tmp_path / "slow.wav", longest=0.1).num_rows == 100
    label = pa.array([[["a"]]], pa.list_(pa.list_(pa.string())))
    table = manifest(audio / "short.wav", longest=1).append_column("notes", label)
    found = join_pieces(extract_batch(table, config=FRAMES))
    assert found["notes"].to_pylist() == [[["a"]]]
