"""Records of frames as tensors; this module needs PyTorch."""

from typing import Any

import numpy as np
import torch
from torch.utils.data import Dataset

from vbaa_bench.dataset.frame_records import FrameRecords, Record


class TorchRecords(FrameRecords, Dataset):  # type: ignore[misc]  # torch may be absent
    """Records of frames with tensors in place of arrays and of 32-bit numbers."""

    def _record(self, number: int) -> Record:
        return {name: _tensors(value) for name, value in super()._record(number).items()}


def _tensors(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _tensors(inner) for name, inner in value.items()}
    return torch.as_tensor(value) if isinstance(value, np.ndarray | np.generic) else value
