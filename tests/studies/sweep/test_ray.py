"""A Ray cluster on this machine: the same table as local processes, whatever its nodes do."""

import time

import pytest

from beaver_ftc.studies.sweep.campaign import Options, run_sweep

from .conftest import sweep_of


@pytest.fixture(scope="module")
def cluster():
    ray = pytest.importorskip("ray", reason="Ray is not installed: pip install 'beaver-ftc[ray]'")
    from ray.cluster_utils import Cluster

    head = {"num_cpus": 2, "include_dashboard": False}
    try:
        nodes = Cluster(initialize_head=True, head_node_args=head)
    except Exception as error:
        pytest.skip(f"no Ray cluster can be started here: {error}")
    ray.init(address=nodes.address, log_to_driver=False)
    yield nodes
    ray.shutdown()
    nodes.shutdown()


@pytest.fixture
def local(tmp_path, small_batches):
    run_sweep(sweep_of(), Options(out=tmp_path / "local", workers=2, report=False))
    return (tmp_path / "local" / "short" / "results.parquet").read_bytes()


def test_a_cluster_gives_the_table_of_local_processes(cluster, local, tmp_path):
    run_sweep(sweep_of(), Options(out=tmp_path, backend="ray", report=False))
    assert (tmp_path / "short" / "results.parquet").read_bytes() == local


def test_flights_of_a_node_that_is_lost_are_flown_again(cluster, local, tmp_path):
    import ray

    extra = cluster.add_node(num_cpus=2)
    patience = time.monotonic() + 30
    while ray.cluster_resources().get("CPU", 0) < 4 and time.monotonic() < patience:
        time.sleep(0.1)
    lost = []

    def lose_a_node(tally):
        if not lost and tally["done"] >= 8:
            lost.append(cluster.remove_node(extra, allow_graceful=False))

    run_sweep(sweep_of(), Options(out=tmp_path, backend="ray", report=False), lose_a_node)
    assert lost
    assert (tmp_path / "short" / "results.parquet").read_bytes() == local
