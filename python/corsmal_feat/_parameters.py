"""Parameters and state of estimators, as scikit-learn handles them."""

from __future__ import annotations

import inspect
import sys
from typing import Any, Self

from ._core import ParameterError


class NotFittedError(ValueError, AttributeError):
    """`predict` was called before `fit`."""


def not_fitted(estimator: object) -> Exception:
    """The error of an estimator that needs `fit` first."""
    message = (
        f"This {type(estimator).__name__} instance is not fitted yet. Call 'fit' with appropriate "
        "arguments before using this estimator."
    )
    # scikit-learn's own class where it is in use: callers there catch that one.
    exceptions = sys.modules.get("sklearn.exceptions")
    return exceptions.NotFittedError(message) if exceptions else NotFittedError(message)


class Parametrised:
    """An estimator whose parameters are those of its `__init__`, kept under the same names."""

    @classmethod
    def _keywords(cls) -> list[str]:
        return [name for name in inspect.signature(cls.__init__).parameters if name != "self"]

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """The parameters by name; `deep` is scikit-learn's and has no effect."""
        return {name: getattr(self, name) for name in self._keywords()}

    def set_params(self, **params: Any) -> Self:
        """Changes parameters by name; they count from the next `fit` on."""
        known = self._keywords()
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
