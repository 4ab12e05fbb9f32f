"""What is saved of the machine."""


def pytest_benchmark_update_machine_info(config, machine_info):
    """The machine's name is nobody's business."""
    machine_info.pop("node", None)


def pytest_benchmark_update_json(config, benchmarks, output_json):
    """Of every benchmark what the report reads, not each of its rounds."""
    for one in output_json["benchmarks"]:
        one["stats"].pop("data", None)
        one.pop("options", None)
