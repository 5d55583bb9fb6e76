"""Writes the samples beside it: python make_samples.py.

Needs soundfile 0.13 (libsndfile 1.2), ffmpeg 5 with libvorbis and libopus, flac, sndfile-convert and
lame 3.100.
"""

import subprocess
import tempfile
from pathlib import Path

import numpy as np
import soundfile

HERE = Path(__file__).parent
FRAMES = 3000


def run(*command):
    """Runs a command, which must succeed."""
    subprocess.run([str(part) for part in command], check=True, capture_output=True)


i, c = np.ogrid[:FRAMES, :8]
steps = ((i * 37 + c * 1001) % 20011 - 10005).astype(np.int16)
soundfile.write(HERE / "steps-8ch-16bit.flac", steps, 48000)

t = np.arange(30000) / 44100
sines = np.stack([0.5 * np.sin(2 * np.pi * hz * t) for hz in (440, 1000)], 1)
# A little noise makes the stream long enough for more than one Ogg page.
sines += 0.003 * np.random.default_rng(0).standard_normal(sines.shape)
soundfile.write(HERE / "sines-2ch.ogg", sines, 44100)
soundfile.write(HERE / "sine-1ch.mp3", sines[:, 0], 44100)

with tempfile.TemporaryDirectory() as folder:
    folder = Path(folder)
    # Bursts, so that frames of constant size lend each other room.
    decay = np.exp(-(np.arange(12000) % 3000) / 300)
    bursts = np.random.default_rng(1).standard_normal((12000, 2)) * decay[:, None]
    soundfile.write(folder / "bursts.wav", 0.2 * bursts, 44100)
    run("lame", "--cbr", "-b", "96", "--resample", "44.1", folder / "bursts.wav", HERE / "bursts-2ch-cbr.mp3")
    # Sixteen blocks of 192 samples, the last one shorter.
    soundfile.write(folder / "steps.wav", steps[:, :2], 48000)
    run("flac", "-s", "-f", "-b", "192", "-o", HERE / "steps-2ch-blocks.flac", folder / "steps.wav")
    for kind in ("ima", "ms"):
        wav = HERE / f"sines-2ch-{kind}.wav"
        soundfile.write(folder / "sines.wav", sines[:1500], 8000)
        run("sndfile-convert", f"-{kind}-adpcm", folder / "sines.wav", wav)
        soundfile.read(wav, dtype="int16")[0].astype("<i2").tofile(HERE / f"sines-2ch-{kind}.s16")
    # Each channel a sine of its own level, so that mixed-up channels show.
    for channels in (4, 6, 8):
        many = np.stack([np.sin(2 * np.pi * 300 * t[:6000]) * (n + 1) / 10 for n in range(channels)], 1)
        soundfile.write(folder / "many.wav", many, 44100)
        layout = {4: "quad", 6: "5.1", 8: "7.1"}[channels]
        source = ["ffmpeg", "-y", "-channel_layout", layout, "-i", folder / "many.wav"]
        run(*source, "-c:a", "libvorbis", "-q:a", "1", HERE / f"levels-{channels}ch.ogg")
        if channels == 8:
            opus = ["-c:a", "libopus", "-mapping_family", "255", "-b:a", "128k"]
            run(*source, *opus, HERE / "levels-8ch.opus")

    # AAC in ADTS, in MP4 (index at the end) and in fragments: 10 packets and 65 samples after the
    # encoder's delay of 1024; no noise that a decoder makes up. ALAC: a packet of 4096 and the rest.
    soundfile.write(folder / "sines.wav", sines[:9281], 44100)
    aac = ["ffmpeg", "-y", "-i", folder / "sines.wav", "-bitexact"]
    aac += ["-c:a", "aac", "-b:a", "64k", "-aac_pns", "0"]
    run(*aac, HERE / "sines-2ch.aac")
    run(*aac, HERE / "sines-2ch.m4a")
    fragments = ["-movflags", "frag_keyframe+empty_moov+default_base_moof", "-frag_duration", "50000"]
    run(*aac, *fragments, HERE / "sines-2ch-fragments.mp4")
    i, c = np.ogrid[:5000, :6]
    steps = ((i * 37 + c * 1001) % 20011 - 10005).astype(np.int16)
    soundfile.write(folder / "steps.wav", steps, 48000)
    run("ffmpeg", "-y", "-i", folder / "steps.wav", "-c:a", "alac", "-bitexact", HERE / "steps-6ch.m4a")

    # Opus. Noise beyond full scale, whose packets of 60 ms hold frames of more than 1500 bytes in all;
    # and clicks in two channels, which short blocks code.
    noise = np.random.default_rng(1).uniform(-1, 1, (11520, 2))
    soundfile.write(folder / "noise.wav", noise, 48000)
    opus = ["opusenc", "--quiet", "--serial", "1"]
    run(*opus, "--bitrate", "256", "--framesize", "60", folder / "noise.wav", HERE / "noise-2ch.opus")
    clicks = 0.05 * noise
    clicks[::1500] = (0.9, -0.7)
    soundfile.write(folder / "clicks.wav", clicks, 48000)
    run(*opus, "--bitrate", "96", folder / "clicks.wav", HERE / "clicks-2ch.opus")
