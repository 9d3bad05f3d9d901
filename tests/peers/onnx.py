"""The network's inference by ONNX Runtime, in f32 and in the int8 ways it has: a peer that checks ours and is timed against it.

    onnx.py FOLDER [--check | --repeat N] [--ours COMMAND]
    onnx.py --self-test [--repeat N]

Packages: onnxruntime==1.32.0 onnx==1.23.2 onnx-ir==1.1.0 sympy==1.14.0 numpy==2.4.6.

FOLDER holds
  model.safetensors  an f32 model of ours
  case.safetensors   one window of F frames, T tags, A antennas, and what our f32 says of it at temperature 1:
                     maps U8 (F, 3, P, P), scalars F32 (F, 6), reads F32 (F, T, A, 6), names F32 (T, E),
                     actions F32 (8), targets F32 (T)

The network becomes two graphs, as a frame at a time runs it: `encoder`, one frame to its radar token, and `rest`, the tokens,
reads and names of the window to the probabilities. Each is written in more than one form, and each form runs in f32 and in
int8 of several kinds (`WAYS`). The f32 must give the case's probabilities, or the exit status is not 0.

Times are at batch 1 with 1 and 2 threads: first a look at all, least times, then N rounds of the fastest by turns, medians of
rounds' medians, and between the rounds COMMAND, which prints one line of JSON with our times in milliseconds:
  {"f32": {"1": {"encoder": ms, "rest": ms, "sum": ms}, "2": {...}}, "int8": {...}}
where 1 and 2 are threads, and what is not there is not compared. `sum` is the time from the last frame to the answer. An int8
way whose probabilities are further from the f32's than USABLE is listed but not picked.

On stdout one line of JSON, milliseconds and largest differences of probabilities; on stderr a table.
"""

import sys
from pathlib import Path

# This file's folder is where Python looks first, and there `onnx` would be this file: it looks there last.
FOLDER = Path(__file__).resolve().parent
sys.path = [entry for entry in sys.path if Path(entry or ".").resolve() != FOLDER] + [str(FOLDER)]
# And it stays clean.
sys.dont_write_bytecode = True

import argparse
import json
import logging
import shlex
import statistics
import subprocess
import tempfile
import time

import numpy as np
import onnx
import onnxruntime
from onnx import TensorProto, helper, numpy_helper
from onnxruntime import quantization
from onnxruntime.quantization import matmul_nbits_quantizer

import network_reference as reference
from network_graphs import IR_VERSION, OPSET, Case, Mismatch, Model, encoder_graph, rest_graph, write_safetensors

# Largest difference of f32 probabilities that passes, and of int8's that can stand for the network.
F32_BOUND = 1e-4
USABLE = 0.1
THREADS = (1, 2)
# Frames of the case that ranges of the encoder's values are taken from, evenly spread.
CALIBRATION_FRAMES = 12
# First looks at each way and seconds of one, seconds of one turn of a way and turns in a round.
LOOKS, LOOK, TURN, TURNS = 2, 0.15, 0.1, 5
# Fastest ways that go into the rounds.
FINALISTS = 3


# int8


class Calibration(quantization.CalibrationDataReader):
    def __init__(self, feeds):
        self.feeds = iter(feeds)

    def get_next(self):
        return next(self.feeds, None)


DENSE = ["MatMul", "Gemm", "Attention"]
# How each int8 is asked for: of the activations' ranges as they come, of ranges from the case, of weights in blocks.
DYNAMIC = {
    "dynamic": {"op_types_to_quantize": DENSE, "weight_type": quantization.QuantType.QInt8},
    "dynamic-conv": {"op_types_to_quantize": [*DENSE, "Conv"], "weight_type": quantization.QuantType.QInt8},
    # The only weights that its integer convolution takes.
    "dynamic-conv-u8": {"op_types_to_quantize": [*DENSE, "Conv"], "weight_type": quantization.QuantType.QUInt8},
}
LAYERS = ["MatMul", "Gemm", "Conv", "MaxPool", "LeakyRelu", "Flatten"]
QDQ, QOPERATOR = quantization.QuantFormat.QDQ, quantization.QuantFormat.QOperator
WEIGHTS_ONLY = {"MatMulConstBOnly": True}
STATIC = {
    "qdq": {"quant_format": QDQ},
    "qdq-layers": {"quant_format": QDQ, "op_types_to_quantize": LAYERS, "extra_options": WEIGHTS_ONLY},
    # Dense layers that leave f32 behind them.
    "qdq-open": {
        "quant_format": QDQ,
        "op_types_to_quantize": LAYERS,
        "extra_options": WEIGHTS_ONLY | {"OpTypesToExcludeOutputQuantization": ["MatMul", "Gemm"]},
    },
    "qoperator": {"quant_format": QOPERATOR},
    "qoperator-layers": {"quant_format": QOPERATOR, "op_types_to_quantize": LAYERS, "extra_options": WEIGHTS_ONLY},
}
# Inputs of a block. Made for one row at a time, as the encoder has; with more rows it is slower than f32.
BLOCKS = {"blocks-128": 128}
# Ways of each graph. What is left out does the same as another: there is no convolution in the rest, and ranges from the case
# cannot be had of `fused` attention, nor of `joined` attention's inside.
WAYS = {
    "encoder": {form: ["f32", *DYNAMIC, *STATIC, *BLOCKS] for form in ("grouped", "apart")},
    "rest": {
        "plain": ["f32", "dynamic", "qdq", "qoperator"],
        "joined": ["f32", "dynamic", *STATIC],
        "fused": ["f32", "dynamic"],
    },
}


def quantise(precision, model, feeds, folder):
    """The model's bytes in a precision."""
    if precision in BLOCKS:
        return in_blocks(model, BLOCKS[precision])
    source, result = folder / "f32.onnx", folder / "int8.onnx"
    onnx.save(model, source)
    if precision in DYNAMIC:
        quantization.quantize_dynamic(source, result, per_channel=True, **DYNAMIC[precision])
        return result.read_bytes()
    kinds = {"activation_type": quantization.QuantType.QUInt8, "weight_type": quantization.QuantType.QInt8}
    options = {"per_channel": True, **kinds, **STATIC[precision]}
    quantization.quantize_static(source, result, Calibration(feeds), **options)
    return codes_as_they_are(onnx.load(result)).SerializeToString()


def codes_as_they_are(model):
    """Without the way from codes to f32 and back to the same codes."""
    constants = {c.name: numpy_helper.to_array(c) for c in model.graph.initializer}
    casts = {node.output[0]: node.input[0] for node in model.graph.node if node.op_type == "Cast"}
    for node in [n for n in model.graph.node if n.op_type == "QuantizeLinear" and n.input[0] in casts]:
        if constants[node.input[1]] == 1 and constants[node.input[2]] == 0:
            for other in model.graph.node:
                for place, name in enumerate(other.input):
                    if name == node.output[0]:
                        other.input[place] = casts[node.input[0]]
            model.graph.node.remove(node)
    used = {name for node in model.graph.node for name in node.input}
    for node in [n for n in model.graph.node if n.op_type == "Cast" and n.output[0] not in used]:
        model.graph.node.remove(node)
    return model


def in_blocks(model, size):
    """Weights of dense layers by blocks of inputs, activations quantised as they come."""
    split = onnx.ModelProto()
    split.CopyFrom(model)
    del split.graph.node[:]
    for node in model.graph.node:
        if node.op_type == "Gemm":
            product = f"{node.output[0]}_product"
            split.graph.node.append(helper.make_node("MatMul", node.input[:2], [product], node.name))
            split.graph.node.append(helper.make_node("Add", [product, node.input[2]], node.output, f"{node.name}_bias"))
        else:
            split.graph.node.append(node)
    work = matmul_nbits_quantizer.MatMulNBitsQuantizer(split, block_size=size, is_symmetric=True, bits=8, accuracy_level=4)
    work.process()
    return work.model.model.SerializeToString()


# Runs


class Run:
    """A graph that is ready, with its input and room for its output bound."""

    def __init__(self, graph, feeds, threads):
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads, options.inter_op_num_threads = threads, 1
        options.execution_mode = onnxruntime.ExecutionMode.ORT_SEQUENTIAL
        options.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_ENABLE_ALL
        options.log_severity_level = 4
        self.session = onnxruntime.InferenceSession(graph, options, providers=["CPUExecutionProvider"])
        self.bound = self.session.io_binding()
        for name, values in feeds.items():
            self.bound.bind_cpu_input(name, np.ascontiguousarray(values))
        self.out = {}
        for output in self.session.get_outputs():
            place = onnxruntime.OrtValue.ortvalue_from_shape_and_type(output.shape, np.float32)
            self.bound.bind_ortvalue_output(output.name, place)
            self.out[output.name] = place

    def of(self, feeds):
        """Results of some input."""
        names = [output.name for output in self.session.get_outputs()]
        return dict(zip(names, self.session.run(names, feeds)))

    def times(self, seconds, least=5):
        """Milliseconds of runs, warmed up, for so long."""
        run, bound = self.session.run_with_iobinding, self.bound
        for _ in range(3):
            run(bound)
        times, end = [], time.perf_counter() + seconds
        while len(times) < least or time.perf_counter() < end:
            start = time.perf_counter()
            run(bound)
            times.append((time.perf_counter() - start) * 1e3)
        return times


def call_overhead():
    """Milliseconds of a run that does next to nothing: what each time holds of Python."""
    value = helper.make_tensor_value_info("value", TensorProto.FLOAT, [1])
    out = helper.make_tensor_value_info("out", TensorProto.FLOAT, [1])
    graph = helper.make_graph([helper.make_node("Neg", ["value"], ["out"])], "nothing", [value], [out])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION)
    run = Run(model.SerializeToString(), {"value": np.zeros(1, np.float32)}, 1)
    return statistics.median(run.times(LOOK))


def difference(got, want):
    """Largest, of all probabilities; what is no number differs by 1."""
    return max(float(np.nan_to_num(np.abs(got[name] - want[name]), nan=1.0).max()) for name in ("actions", "targets"))


class Peer:
    """Both graphs in all forms and precisions."""

    def __init__(self, folder):
        self.model = Model(folder / "model.safetensors")
        self.case = Case(folder / "case.safetensors", self.model)
        self.graphs = {}
        if self.model.has_radar:
            self.graphs["encoder"] = {form: encoder_graph(self.model, form) for form in WAYS["encoder"]}
        self.graphs["rest"] = {form: rest_graph(self.model, self.case, form) for form in WAYS["rest"]}
        if left := set(self.model.arrays) - self.model.taken:
            raise Mismatch(f"arrays that no graph has taken: {sorted(left)}")
        self.bytes, self.failed = {}, {}
        self.check()

    def tokens(self, graph):
        if not self.model.has_radar:
            return None
        run = Run(graph, self.case.frame(0), 1)
        return np.concatenate([run.of(self.case.frame(n))["token"] for n in range(self.case.frames)])

    def answer(self, graph, tokens):
        window = self.case.window(self.model, tokens)
        return Run(graph, window, 1).of(window)

    def check(self):
        """f32 of all forms against the case."""
        encoders = self.graphs.get("encoder", {"": None})
        tokens = [self.tokens(encoder and encoder.SerializeToString()) for encoder in encoders.values()]
        self.f32_tokens = tokens[0]
        window = self.case.window(self.model, self.f32_tokens)
        rests = {form: Run(graph.SerializeToString(), window, 1) for form, graph in self.graphs["rest"].items()}
        # What any tokens lead to is asked of this one.
        self.f32_rest = rests["plain"]
        self.f32 = self.f32_rest.of(window)
        answers = [run.of(window) for run in rests.values()]
        answers += [self.f32_rest.of(self.case.window(self.model, other)) for other in tokens[1:]]
        for name, values in self.case.want.items():
            if self.f32[name].shape != values.shape:
                raise Mismatch(f"{name} is {self.f32[name].shape}, the case has {values.shape}")
        self.difference = max(difference(answer, self.case.want) for answer in answers)
        if not self.difference <= F32_BOUND:
            raise Mismatch(f"f32 probabilities differ by {self.difference:.2e}, {F32_BOUND} pass")

    def prepare(self, folder):
        """All ways as bytes, with how far their answers are from the f32's."""
        some = range(0, self.case.frames, -(-self.case.frames // CALIBRATION_FRAMES))
        frames = [self.case.frame(number) for number in some]
        feeds = {"encoder": frames, "rest": [self.case.window(self.model, self.f32_tokens)]}
        self.differences = {}
        for graph, forms in self.graphs.items():
            for form, model in forms.items():
                for precision in WAYS[graph][form]:
                    way = graph, f"{form}.{precision}"
                    try:
                        made = model.SerializeToString()
                        if precision != "f32":
                            made = quantise(precision, model, feeds[graph], folder)
                        if graph == "encoder":
                            got = self.f32_rest.of(self.case.window(self.model, self.tokens(made)))
                        else:
                            got = self.answer(made, self.f32_tokens)
                    except Exception as error:  # What it cannot do is part of the result.
                        self.failed[way] = str(error).strip().splitlines()[0][:200]
                        continue
                    self.bytes[way], self.differences[way] = made, difference(got, self.f32)

    def run(self, way, threads):
        feeds = self.case.frame(self.case.frames - 1) if way[0] == "encoder" else None
        return Run(self.bytes[way], feeds or self.case.window(self.model, self.f32_tokens), threads)

    def look(self):
        """Each way by itself: least milliseconds by way and threads, which a busy machine distorts least."""
        found = {}
        for _ in range(LOOKS):
            for key in [(*way, threads) for way in self.bytes for threads in THREADS]:
                found[key] = min(found.get(key, np.inf), *self.run(key[:2], key[2]).times(LOOK))
        return found

    def finalists(self, look, threads):
        """The fastest ways by graph and precision."""
        chosen = {}
        for graph in self.graphs:
            for precision in ("f32", "int8"):
                usable = [w for w in self.bytes if w[0] == graph and w[1].endswith(".f32") == (precision == "f32")]
                usable = [w for w in usable if self.differences[w] <= USABLE]
                usable.sort(key=lambda w: look[(*w, threads)])
                if not usable:
                    raise Mismatch(f"no {precision} of {graph} can be used")
                chosen[graph, precision] = usable[:FINALISTS]
        return chosen

    def together(self, ways):
        """Largest difference with both graphs in their ways."""
        return difference(self.answer(self.bytes[ways["rest"]], self.tokens(self.bytes.get(ways.get("encoder")))), self.f32)


# Rounds


def one_round(runs):
    """Median and least time of each, by turns."""
    times = {way: [] for way in runs}
    for _ in range(TURNS):
        for way, run in runs.items():
            times[way] += run.times(TURN, least=2)
    return {way: (statistics.median(t), min(t)) for way, t in times.items()}


def ours_once(command):
    done = subprocess.run(shlex.split(command), capture_output=True, text=True)
    if done.returncode:
        raise Mismatch(f"{command} ended with {done.returncode}: {done.stderr.strip()[-500:]}")
    return json.loads(done.stdout.strip().splitlines()[-1])


def median_of(tables):
    """Tables of tables of numbers, the median at each place."""
    if isinstance(tables[0], dict):
        return {key: median_of([table[key] for table in tables]) for key in tables[0]}
    return statistics.median(tables)


def measure(peer, repeat, command):
    look = peer.look()
    chosen = {threads: peer.finalists(look, threads) for threads in THREADS}
    medians, ours = {}, []
    for _ in range(repeat):
        for threads in THREADS:
            runs = {way: peer.run(way, threads) for ways in chosen[threads].values() for way in ways}
            for way, value in one_round(runs).items():
                medians.setdefault((*way, threads), []).append(value)
        if command:
            ours.append(ours_once(command))
    finals = {key: statistics.median(m for m, _ in values) for key, values in medians.items()}
    least = {key: min(l for _, l in values) for key, values in medians.items()}
    best = {}
    for precision in ("f32", "int8"):
        for threads in THREADS:
            ways = {g: min(chosen[threads][g, precision], key=lambda w: finals[(*w, threads)]) for g in peer.graphs}
            row = {graph: finals[(*way, threads)] for graph, way in ways.items()}
            row |= {"sum": sum(row.values()), "ways": {graph: way[1] for graph, way in ways.items()}}
            row["least"] = {graph: least[(*way, threads)] for graph, way in ways.items()}
            row["difference"] = peer.together(ways)
            best.setdefault(precision, {})[str(threads)] = row
    ours = median_of(ours) if ours else {}
    return look, best, ours, ratios(best, ours)


def ratios(theirs, ours):
    """Their times over ours of the same precision, and of our most threads where we have none of so many."""
    found = {}
    for precision, by_threads in theirs.items():
        for threads, row in by_threads.items():
            there = [t for t in ours.get(precision, {}) if int(t) <= int(threads)]
            if there:
                of_ours = ours[precision][max(there, key=int)]
                values = {part: row[part] / of_ours[part] for part in ("encoder", "rest", "sum") if part in row and part in of_ours}
                found.setdefault(precision, {})[threads] = {"ours": int(max(there, key=int)), **values}
    return found


def report(peer, look, best, ours, ratio):
    """A table on stderr; the same for JSON."""
    say = lambda text="": print(text, file=sys.stderr)
    overhead = call_overhead()
    case, shape = peer.case, {"frames": peer.case.frames, "tags": peer.case.count, "points": peer.model.config["points"]}
    say(f"{shape['frames']} frames, {shape['tags']} tags, maps of {shape['points']} points; ms, batch 1")
    say(f"f32 differs from the case by {peer.difference:.1e}; a call's overhead is {overhead:.4f} ms")
    ways = {}
    for graph in peer.graphs:
        say(f"{graph:34} {'1 thread':>10} {'2 threads':>10} {'difference':>11}")
        for way in sorted((w for w in peer.bytes if w[0] == graph), key=lambda w: look[(*w, 1)]):
            times = {str(t): look[(*way, t)] for t in THREADS}
            ways.setdefault(graph, {})[way[1]] = {**times, "difference": peer.differences[way]}
            say(f"  {way[1]:32} {times['1']:10.4f} {times['2']:10.4f} {peer.differences[way]:11.1e}")
    for (graph, way), reason in peer.failed.items():
        say(f"  {graph} {way}: {reason}")
    say("best: medians of rounds")
    for precision, by_threads in best.items():
        for threads, row in by_threads.items():
            times = ", ".join(f"{part} {row[part]:.4f}" for part in (*peer.graphs, "sum"))
            ways_of = ", ".join(f"{graph} {row['ways'][graph]} (least {row['least'][graph]:.4f})" for graph in peer.graphs)
            say(f"  {precision} {threads}: {times}; difference {row['difference']:.1e}; {ways_of}")
    for precision, by_threads in ours.items():
        for threads, row in by_threads.items():
            say(f"  ours {precision} {threads}: " + ", ".join(f"{part} {value:.4f}" for part, value in row.items()))
    for precision, by_threads in ratio.items():
        for threads, row in by_threads.items():
            values = ", ".join(f"{part} {row[part]:.2f}" for part in row if part != "ours")
            say(f"  theirs over ours, {precision}, {threads} thread(s) over {row['ours']}: {values}")
    versions = {"onnxruntime": onnxruntime.__version__, "onnx": onnx.__version__, "numpy": np.__version__}
    failed = {f"{graph}.{way}": reason for (graph, way), reason in peer.failed.items()}
    head = {"versions": versions, **shape, "f32_difference": peer.difference, "overhead": overhead}
    return {**head, "look": ways, "failed": failed, "best": best, "ours": ours, "ratios": ratio}


def compare(folder, repeat, command):
    peer = Peer(folder)
    with tempfile.TemporaryDirectory() as work:
        peer.prepare(Path(work))
    print(json.dumps(report(peer, *measure(peer, repeat, command))), flush=True)


# Self-test: random networks


def write_folder(folder, weights, config, case):
    description = {"version": 1, "precision": "f32", "config": config}
    write_safetensors(folder / "model.safetensors", weights, {"rf-hoi": json.dumps(description)})
    write_safetensors(folder / "case.safetensors", case)


def self_test(repeat):
    random = np.random.default_rng(1)
    for name, (config, *sizes) in (reference.ODD | reference.TIMED).items():
        with tempfile.TemporaryDirectory() as folder:
            folder = Path(folder)
            weights, case = reference.random_weights(config, random), reference.random_case(config, random, *sizes)
            case |= {part: values.astype(np.float32) for part, values in reference.answer_of(weights, config, case).items()}
            write_folder(folder, weights, config, case)
            print(f"{name}: f32 differs by {Peer(folder).difference:.1e}", file=sys.stderr)
            if name in reference.TIMED:
                compare(folder, repeat, None)
            else:
                every_array_matters(folder, weights, config, case)


def every_array_matters(folder, weights, config, case):
    """A model with other values in any one array must be found out."""
    random = np.random.default_rng(2)
    # What adds the same to all of a softmax's scores does not matter.
    same = "heads.target" if config["fusion"] == "radar" or len(case["names"]) == 1 else "heads.target.second.bias"
    for name, values in weights.items():
        if name.startswith(same):
            continue
        other = values + random.normal(1, 1, values.shape).astype(np.float32)
        write_folder(folder, weights | {name: other}, config, case)
        try:
            Peer(folder)
        except Mismatch:
            continue
        raise Mismatch(f"a wrong {name} was not found out")


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("folder", type=Path, nargs="?")
    arguments.add_argument("--repeat", type=int, default=3, metavar="N", help="rounds")
    arguments.add_argument("--ours", metavar="COMMAND", help="prints our times as one line of JSON")
    arguments.add_argument("--check", action="store_true", help="only hold its f32 against ours")
    arguments.add_argument("--self-test", action="store_true", help="random networks against numpy, no folder")
    given = arguments.parse_args()
    if given.self_test == (given.folder is not None) or given.repeat < 1:
        arguments.error("either a folder or --self-test, and at least one round")
    logging.disable(logging.WARNING)
    onnxruntime.set_default_logger_severity(4)
    try:
        if given.self_test:
            self_test(given.repeat)
        elif given.check:
            print(f"f32 differs by {Peer(given.folder).difference:.1e}", file=sys.stderr)
        else:
            compare(given.folder, given.repeat, given.ours)
    except Mismatch as mismatch:
        sys.exit(str(mismatch))


if __name__ == "__main__":
    main()
