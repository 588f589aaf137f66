"""Writes docs/estimators.md, the estimators of scikit-learn that work: ``python docs/make_estimators.py``."""

from pathlib import Path

import sklearn

from dovetail_plugins.scikit_learn import working_estimators

PAGE = Path(__file__).with_name("estimators.md")
TEXT = """# Estimators of scikit-learn

Here you find the transformers of scikit-learn that can be a reducer, and the regressors that can be a regressor.
Others are refused when the description is read, before anything is generated or fitted, because what they fit is
not made of arrays, so that a model could not be stored without pickle. A few that are missing here, such as
`GaussianRandomProjection`, need options to be fitted, and work with them.

In a description:

```yaml
identification:
  reducer: {{model: sklearn, estimator: KernelPCA, options: {{n_components: 30, kernel: rbf}}}}
  regressor: {{model: sklearn, estimator: KernelRidge, options: {{kernel: rbf, alpha: 0.1}}}}
```

In Python, as objects:

```python
from sklearn.decomposition import KernelPCA
from sklearn.kernel_ridge import KernelRidge

model = dovetail.train(assembly, reducer=KernelPCA(30, kernel="rbf"), regressor=KernelRidge(kernel="rbf", alpha=0.1))
```

Tried with scikit-learn {version} by `python docs/make_estimators.py`, each with its default options.

## Transformers, as reducers

{transformers}

## Regressors

{regressors}
"""


def names_in(text: str) -> list[str]:
    """Return the estimators that a section of the page lists."""
    return [line.removeprefix("- `").removesuffix("`") for line in text.splitlines() if line.startswith("- `")]


def page() -> str:
    """Return the text of the page."""
    lists = ["\n".join(f"- `{name}`" for name in working_estimators(method)) for method in ("transform", "predict")]
    version = ".".join(sklearn.__version__.split(".")[:2])
    return TEXT.format(version=version, transformers=lists[0], regressors=lists[1])


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
