"""Laws of the network that only has to be fast."""

import copy

import torch
from torch import nn

from resdepth_colmap.network.inference import for_inference
from resdepth_colmap.network.network_config import NetworkConfig
from resdepth_colmap.network.unet import ResDepthNet


def test_it_says_the_same_without_its_norms() -> None:
    torch.manual_seed(0)
    config = NetworkConfig(levels=2, base_channels=4, max_channels=8)
    network = ResDepthNet(config)
    for module in network.modules():
        if isinstance(module, nn.BatchNorm2d):
            for value in (module.weight, module.bias, module.running_mean):
                assert value is not None
                nn.init.normal_(value, std=0.5)
            assert module.running_var is not None
            nn.init.uniform_(module.running_var, 0.5, 2.0)
        elif isinstance(module, nn.Conv2d):
            nn.init.normal_(module.weight, std=0.2)
    network.eval()
    stack = torch.randn(2, len(config.channels), 16, 24)
    with torch.inference_mode():
        expected = network(stack, torch.sin)
        fast = for_inference(copy.deepcopy(network))
        actual = fast(stack, torch.sin)
    assert not any(isinstance(module, nn.BatchNorm2d) for module in fast.modules())
    assert expected.inverse_depth.std() > 0.5
    for name in ("inverse_depth", "log_scale"):
        torch.testing.assert_close(
            getattr(actual, name), getattr(expected, name), rtol=1e-3, atol=1e-3
        )
