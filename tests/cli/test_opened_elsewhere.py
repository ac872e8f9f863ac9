"""What commands write opens elsewhere: every .csv in pandas as it is, every .nc in xarray."""

import pytest

COMMANDS = {
    "estimate": ["estimate", "b612-range"],
    "compare": ["compare", "b612-range", "--with", "ekf", "--with", "graph"],
    "windows": ["windows", "b612-range", "--lags", "1,5", "--no-graph"],
    "observability": ["observability", "b612-range-q0", "--no-twins"],
    "simulate": ["simulate", "b612-range"],
}


@pytest.mark.parametrize("name", COMMANDS)
def test_a_table_opens_in_pandas(call, tmp_path, name):
    import pandas as pd

    path = tmp_path / f"{name}.csv"
    assert call(*COMMANDS[name], "-o", path).status == 0
    table = pd.read_csv(path)
    assert len(table) >= 2 and not [column for column in table.columns if column.startswith("Unnamed")]
    numbers = table.select_dtypes("number")
    assert len(numbers.columns) >= 2 and numbers.notna().any().sum() >= 2


@pytest.mark.parametrize("name", ["estimate", "simulate"])
def test_a_file_opens_in_xarray(call, tmp_path, name):
    import xarray

    path = tmp_path / f"{name}.nc"
    assert call(*COMMANDS[name], "-o", path).status == 0
    with xarray.open_dataset(path) as data:
        assert data.sizes["time"] == 100 and not [v for v in data.variables if hasattr(xarray.Dataset, v)]
