"""What a study leaves on disk: rows, labels, locks, and where they came from.

Each name is imported when it is first used: `studies.status` reads folders without loading what writes them.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from studies.storage.atomic import atomic_write as atomic_write
    from studies.storage.folders import LOCK_FILE as LOCK_FILE
    from studies.storage.folders import PLAN_FILE as PLAN_FILE
    from studies.storage.folders import ROWS_FILE as ROWS_FILE
    from studies.storage.folders import TABLE_FILE as TABLE_FILE
    from studies.storage.folders import default_results as default_results
    from studies.storage.folders import planned_ids as planned_ids
    from studies.storage.folders import result_folders as result_folders
    from studies.storage.labels import LabelStore as LabelStore
    from studies.storage.locking import StoreLockedError as StoreLockedError
    from studies.storage.locking import lock_holder as lock_holder
    from studies.storage.placement import Origin as Origin
    from studies.storage.placement import Place as Place
    from studies.storage.placement import others_of_same_variants as others_of_same_variants
    from studies.storage.placement import place as place
    from studies.storage.records import read_config as read_config
    from studies.storage.reuse import find_reusable as find_reusable
    from studies.storage.reuse import read_reusable as read_reusable
    from studies.storage.reuse import rows_file as rows_file
    from studies.storage.rows import RowStore as RowStore
    from studies.storage.rows import StoredRows as StoredRows
    from studies.storage.rows import read_rows as read_rows
    from studies.storage.rows import read_table as read_table
    from studies.storage.summary import summarize as summarize
    from studies.storage.tables import MOST_ROWS as MOST_ROWS
    from studies.storage.tables import write_in_order as write_in_order
    from studies.storage.tables import write_table as write_table
    from studies.storage.text import encodable as encodable

_MODULE_OF = {
    "LOCK_FILE": "folders",
    "LabelStore": "labels",
    "Origin": "placement",
    "MOST_ROWS": "tables",
    "PLAN_FILE": "folders",
    "Place": "placement",
    "ROWS_FILE": "folders",
    "RowStore": "rows",
    "StoreLockedError": "locking",
    "StoredRows": "rows",
    "TABLE_FILE": "folders",
    "atomic_write": "atomic",
    "default_results": "folders",
    "encodable": "text",
    "find_reusable": "reuse",
    "lock_holder": "locking",
    "others_of_same_variants": "placement",
    "place": "placement",
    "planned_ids": "folders",
    "read_config": "records",
    "read_reusable": "reuse",
    "read_rows": "rows",
    "read_table": "rows",
    "result_folders": "folders",
    "rows_file": "reuse",
    "summarize": "summary",
    "write_in_order": "tables",
    "write_table": "tables",
}

__all__ = list(_MODULE_OF)


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULE_OF[name]}"), name)
