"""Files that a command leaves: the folder is tried before the work begins, and each file is whole or not there."""

from tral_fsm.evaluation.results import prepare_folder, write_json

__all__ = ["prepare_folder", "write_json"]
