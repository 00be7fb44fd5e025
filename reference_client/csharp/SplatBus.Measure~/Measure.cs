// SPDX-License-Identifier: MIT
using System;
using System.Diagnostics;
using System.Globalization;

namespace SplatBus.Measure
{
    /// <summary>
    /// What a frame costs: `frames N`, `poses N` or `copies N`, beside a server that the environment
    /// names; prints a JSON object. See benchmarks/engine_clients.py.
    /// </summary>
    static class Measure
    {
        static readonly TimeSpan Patience = TimeSpan.FromSeconds(20);

        static void Main(string[] arguments)
        {
            CultureInfo.CurrentCulture = CultureInfo.InvariantCulture;
            int many = int.Parse(arguments[1]);
            using (var client = new SplatBusClient(ClientOptions.FromEnvironment()))
            {
                for (int i = 0; i < 500; i++) Next(client).Dispose(); // what is compiled at first is no part of it
                if (arguments[0] == "frames") Frames(client, many);
                else if (arguments[0] == "poses") Poses(client, many);
                else Copies(client, many);
            }
        }

        static FrameLease Next(SplatBusClient client)
        {
            FrameLease lease = client.TakeFrame(Patience);
            if (!lease.IsThere) throw new TimeoutException("no image: " + client.Status.Problem);
            return lease;
        }

        static double Microseconds(long ticks) { return 1e6 * ticks / Stopwatch.Frequency; }

        static double Quantile(double[] values, double part)
        {
            Array.Sort(values);
            return values[(int)(part * (values.Length - 1))];
        }

        static void Tell(string name, double value, string other = null, double another = 0)
        {
            string more = other == null ? "" : ", \"" + other + "\": " + another.ToString("f2");
            Console.WriteLine("{\"" + name + "\": " + value.ToString("f2") + more + "}");
        }

        /// <summary>Processor time of all threads, from one frame to the next.</summary>
        static void Frames(SplatBusClient client, int count)
        {
            TimeSpan before = Process.GetCurrentProcess().TotalProcessorTime;
            for (int i = 0; i < count; i++) Next(client).Dispose();
            TimeSpan took = Process.GetCurrentProcess().TotalProcessorTime - before;
            Tell("processor_us", 1e3 * took.TotalMilliseconds / count);
        }

        /// <summary>From a pose that is sent to its image.</summary>
        static void Poses(SplatBusClient client, int count)
        {
            var took = new double[count];
            for (int i = 0; i < count; i++)
            {
                string tag = "m" + i, shown = null;
                long began = Stopwatch.GetTimestamp();
                client.SendCamera(new Pose { X = 0.001 * i, Z = -4, QW = 1 }, null, tag);
                while (shown != tag)
                    using (FrameLease lease = Next(client)) shown = lease.Frame.Camera.Tag;
                took[i] = Microseconds(Stopwatch.GetTimestamp() - began);
            }
            Tell("p50_us", Quantile(took, 0.5), "p99_us", Quantile(took, 0.99));
        }

        /// <summary>Colour and depth of an image into memory of our own, beside the same bytes from our own.</summary>
        static void Copies(SplatBusClient client, int count)
        {
            double[] took = new double[count], floor = new double[count];
            float[] own = null, other = null;
            for (int i = 0; i < count; i++)
                using (FrameLease lease = Next(client))
                {
                    ReadOnlySpan<float> color = lease.Color, depth = lease.Depth;
                    own = own ?? new float[color.Length + depth.Length];
                    other = other ?? new float[own.Length];
                    long began = Stopwatch.GetTimestamp();
                    color.CopyTo(own);
                    depth.CopyTo(own.AsSpan(color.Length));
                    took[i] = Microseconds(Stopwatch.GetTimestamp() - began);
                    began = Stopwatch.GetTimestamp();
                    Buffer.BlockCopy(own, 0, other, 0, 4 * own.Length);
                    floor[i] = Microseconds(Stopwatch.GetTimestamp() - began);
                }
            Tell("copy_us", Quantile(took, 0.5), "floor_us", Quantile(floor, 0.5));
        }
    }
}
