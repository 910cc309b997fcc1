"""The module greybox_bms by its short name: import greybox and import greybox_bms are the same module."""
import sys

import greybox_bms

sys.modules[__name__] = greybox_bms
for _name in ("_core", "exchange"):
    sys.modules[f"{__name__}.{_name}"] = sys.modules[f"greybox_bms.{_name}"]
