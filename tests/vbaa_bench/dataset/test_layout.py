"""Numbers of shards follow from the names of files and folders."""

from vbaa_bench.dataset.layout import shard_hashes, shard_name, shard_numbers


def test_shards_are_numbered_by_their_folders() -> None:
    numbers = [2, 10, 100_000]
    names = [*map(shard_hashes, reversed(numbers)), *map(shard_name, numbers)]
    others = [
        "rig.json",
        "rest/rest_00.png",
        "shard_1/hashes.json",
        "shard_00004x",
        "a/shard_00003",
    ]
    assert shard_numbers([*others, *names]) == numbers
    assert shard_numbers([]) == []
