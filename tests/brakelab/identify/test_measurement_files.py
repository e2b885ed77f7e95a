"""Tables of measurements by their endings, in capitals as well."""

from pathlib import Path

import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq
import pytest

from brakelab.identify.measurement_files import read_columns

TABLE = pa.table({"t": [0.0, 0.1], "omega": [80.0, 79.0]})


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("block.csv", pa_csv.write_csv),
        ("BLOCK.CSV", pa_csv.write_csv),
        ("block.parquet", pq.write_table),
        ("BLOCK.PARQUET", pq.write_table),
    ],
)
def test_the_ending_of_a_block_may_be_in_capitals(tmp_path: Path, name: str, write) -> None:
    write(TABLE, tmp_path / name)
    assert read_columns(tmp_path / name, ("t", "omega"), "block")["omega"].tolist() == [80.0, 79.0]
