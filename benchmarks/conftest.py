"""What is saved of the machine."""


def pytest_benchmark_update_machine_info(config, machine_info):
    """The machine's name is nobody's business."""
    machine_info.pop("node", None)
