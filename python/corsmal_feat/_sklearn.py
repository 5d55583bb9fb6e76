"""scikit-learn's base classes, or stand-ins with the same methods where it is not installed.

Importing scikit-learn takes a second: only the modules of the estimators import this one.
"""

from __future__ import annotations

import inspect
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from .errors import NotFittedError, ParameterError

if TYPE_CHECKING:
    INSTALLED = True
else:
    try:
        from sklearn.base import BaseEstimator, ClassifierMixin, TransformerMixin
        from sklearn.exceptions import DataConversionWarning
        from sklearn.exceptions import NotFittedError as _Theirs

        INSTALLED = True
    except ImportError:
        INSTALLED = False

if TYPE_CHECKING or not INSTALLED:
    _Theirs = ValueError
    DataConversionWarning = UserWarning

    class BaseEstimator:
        """Parameters are those of `__init__`, kept under the same names."""

        @classmethod
        def _get_param_names(cls) -> list[str]:
            return sorted(n for n in inspect.signature(cls.__init__).parameters if n != "self")

        def get_params(self, deep: bool = True) -> dict[str, Any]:
            """The parameters by name; `deep` has no effect here."""
            return {name: getattr(self, name) for name in self._get_param_names()}

        def set_params(self, **params: Any) -> Self:
            """Changes parameters by name; they take effect in the next `fit`."""
            known = self._get_param_names()
            for name, value in params.items():
                if name not in known:
                    raise ParameterError(
                        f"Invalid parameter {name!r} for estimator {self!r}. "
                        f"Valid parameters are: {known}."
                    )
                setattr(self, name, value)
            return self

        def __repr__(self) -> str:
            defaults = inspect.signature(type(self).__init__).parameters
            changed = (
                f"{name}={value!r}"
                for name, value in self.get_params().items()
                if value is not defaults[name].default and value != defaults[name].default
            )
            return f"{type(self).__name__}({', '.join(changed)})"

        def __sklearn_tags__(self) -> Any:
            raise NotImplementedError("scikit-learn is not installed")

    class ClassifierMixin:
        """Scores of classifiers."""

        def score(self, X: Any, y: Any, sample_weight: Any = None) -> float:
            """Share of the rows of `X` whose predicted label is the one in `y`."""
            right = self.predict(X) == np.asarray(y).ravel()  # type: ignore[attr-defined]
            return float(np.average(right, weights=sample_weight))

    class TransformerMixin:
        """Empty, because nothing is needed without scikit-learn."""


class _NotFitted(NotFittedError, _Theirs):
    """Both our error and scikit-learn's, so that callers can catch either."""


def not_fitted(estimator: object) -> Exception:
    """The error of an estimator that needs `fit` first."""
    return _NotFitted(
        f"This {type(estimator).__name__} instance is not fitted yet. Call 'fit' with appropriate "
        "arguments before using this estimator."
    )


__all__ = [
    "BaseEstimator",
    "ClassifierMixin",
    "DataConversionWarning",
    "TransformerMixin",
    "not_fitted",
]
