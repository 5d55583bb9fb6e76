"""What a user writes; mypy --strict and pyright check it, nobody runs it."""

import corsmal_feat as librosa
import numpy as np
import numpy.typing as npt
from corsmal_feat import (
    KNN,
    SVC,
    FeatureExtractor,
    Features,
    RandomForest,
    load_features,
    load_model,
)

Array = npt.NDArray[np.float32 | np.float64]


def describe(path: str) -> Array:
    y, sr = librosa.load(path, sr=None, mono=False)
    trimmed, (start, end) = librosa.effects.trim(y, top_db=40)
    mel: Array = librosa.feature.melspectrogram(y=trimmed, sr=sr, n_mels=64, window=("tukey", 0.3))
    mfcc: Array = librosa.feature.mfcc(S=librosa.power_to_db(mel, ref=np.max), n_mfcc=13)
    rolloff: npt.NDArray[np.float64] = librosa.feature.spectral_rolloff(y=trimmed, sr=sr)
    spectrum = librosa.stft(y, window=np.hanning(2048))
    magnitude, phase = librosa.magphase(spectrum)
    back: Array = librosa.istft(magnitude * phase, length=y.shape[-1])
    time: np.float64 = librosa.frames_to_time(3, sr=sr)
    times: npt.NDArray[np.float64] = librosa.frames_to_time([1, 2], sr=sr)
    hz: npt.NDArray[np.float64] = librosa.mel_to_hz(librosa.hz_to_mel(np.array([440.0])))
    onsets = librosa.onset.onset_detect(y=y, sr=sr, units="time")
    print(time, times, hz, onsets, back.shape, rolloff.max(), int(end) - int(start))
    return mfcc


def learn(paths: list[str], labels: list[str]) -> list[str]:
    extractor = FeatureExtractor("esc26", errors="nan", progress=True)
    rows = extractor.fit_transform(paths)
    weights = np.linspace(0.5, 1.0, len(labels))
    forest = RandomForest(200, oob_score=True, random_state=1).fit(rows, labels, weights)
    print(forest.oob_score_, forest.feature_importances_.argmax())
    values: npt.NDArray[np.float64] = SVC().fit(rows, labels).decision_function(rows)
    distances, nearest = KNN(3).fit(rows, labels).kneighbors(rows[:2])
    positions: npt.NDArray[np.int64] = KNN(3).fit(rows, labels).kneighbors(return_distance=False)
    print(values.max(), distances.min(), nearest.shape, positions.shape)
    forest.save("bottles.model", features=extractor)
    return [str(label) for label in load_model("bottles.model").predict(paths)]


def read(path: str) -> Features:
    features = load_features(path)
    for recording in features:
        print(recording, features[recording].shape)
    return features
