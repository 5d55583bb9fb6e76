"""Features of a manifest with Spark.

    spark-submit spark_features.py manifest.parquet features/

Needs pyspark, pandas, pyarrow and corsmal-feat on all machines.
"""

import os
import sys
from collections.abc import Iterator

import pyarrow as pa
import pyarrow.parquet as pq
from corsmal_feat.arrow import extract_batch
from pyspark.sql import SparkSession
from pyspark.sql.pandas.types import from_arrow_schema

OPTIONS = {"preset": "mfcc-zcr", "channels": 2}


def features(batches: Iterator[pa.RecordBatch]) -> Iterator[pa.RecordBatch]:
    """Computes the batches of a partition, which `mapInArrow` passes one by one."""
    for batch in batches:
        yield extract_batch(batch, **OPTIONS)


def main(manifest: str, out: str) -> None:
    """Computes all rows, and compares their number with the manifest."""
    # Workers start their own Python: this one, unless the cluster says otherwise.
    os.environ.setdefault("PYSPARK_PYTHON", sys.executable)
    batches = ("spark.sql.execution.arrow.maxRecordsPerBatch", "64")
    spark = SparkSession.builder.config(*batches).getOrCreate()
    table = spark.read.parquet(manifest)
    # The schema comes from a call on no rows.
    columns = pq.read_schema(manifest).empty_table()
    empty = extract_batch(columns, **OPTIONS)
    found = table.mapInArrow(features, from_arrow_schema(empty.schema))
    found.write.parquet(out, compression="zstd")
    counted, wanted = spark.read.parquet(out).count(), table.count()
    spark.stop()
    if counted != wanted:
        sys.exit(f"found {counted} of {wanted} rows")
    print(f"{counted} rows")


if __name__ == "__main__":
    main(*sys.argv[1:])
