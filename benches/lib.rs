//! Holder of the benchmarks in `micro/`; see `README.md` there for how to run them.
