// Steers a renderer from a console. There is no console here: a clock presses the keys.
using System;
using System.Collections.Generic;
using System.Globalization;
using System.IO;
using System.Linq;
using System.Net.Sockets;
using System.Threading;
using System.Threading.Tasks;

static class Keys
{
    static readonly string Host = Environment.GetEnvironmentVariable("SPLATBUS_HOST") ?? "127.0.0.1";
    static readonly int Port = int.Parse(Environment.GetEnvironmentVariable("SPLATBUS_MSG_PORT") ?? "6000");
    static readonly DateTime Started = DateTime.UtcNow;
    static readonly Random Fingers = new Random(7);

    static double[] place = { 0, 0, -3 };
    static double yaw;

    static double Clock { get { return (DateTime.UtcNow - Started).TotalSeconds; } }

    static string Spelled(double value) { return value.ToString("R", CultureInfo.InvariantCulture); }

    static string Pose()
    {
        string[] named = place.Select((each, i) => "\"" + "xyz"[i] + "\": " + Spelled(each)).ToArray();
        return "{\"type\": \"camera_pose\", \"position\": {" + string.Join(", ", named) + "}, \"rotation\": {\"x\": 0, \"y\": "
            + Spelled(Math.Sin(yaw / 2)) + ", \"z\": 0, \"w\": " + Spelled(Math.Cos(yaw / 2)) + "}}";
    }

    static async Task Send(Stream stream, string text)
    {
        var payload = System.Text.Encoding.UTF8.GetBytes(text);
        var packet = new byte[4 + payload.Length];
        for (int i = 0; i < 4; i++) packet[i] = (byte)(payload.Length >> 8 * i);
        payload.CopyTo(packet, 4);
        await stream.WriteAsync(packet, 0, packet.Length);
    }

    static async Task Fill(Stream stream, byte[] buffer, int from)
    {
        while (from < buffer.Length)
        {
            int count = await stream.ReadAsync(buffer, from, buffer.Length - from);
            if (count == 0) throw new EndOfStreamException();
            from += count;
        }
    }

    static async Task<byte[]> Rest(Stream stream, byte[] header)
    {
        await Fill(stream, header, 1);
        uint length = header[0] | (uint)header[1] << 8 | (uint)header[2] << 16 | (uint)header[3] << 24;
        if (length == 0 || length > 1 << 20) throw new IOException("a length of " + length);
        using (var payload = new MemoryStream())
        {
            var piece = new byte[4096];
            while (payload.Length < length)
            {
                int count = await stream.ReadAsync(piece, 0, (int)Math.Min(piece.Length, length - payload.Length));
                if (count == 0) throw new EndOfStreamException();
                payload.Write(piece, 0, count);
            }
            return payload.ToArray();
        }
    }

    static async Task<byte[]> Packet(Stream stream)
    {
        var header = new byte[4];
        if (await stream.ReadAsync(header, 0, 1) == 0) throw new EndOfStreamException();
        return await Within(Rest(stream, header), 9.5, "half a packet");
    }

    static async Task<T> Within<T>(Task<T> task, double seconds, string otherwise)
    {
        if (await Task.WhenAny(task, Task.Delay(TimeSpan.FromSeconds(seconds))) != task)
        {
            throw new IOException(otherwise);
        }
        return await task;
    }

    static double[] Numbers(Dictionary<string, object> reply, string name, int count)
    {
        object found;
        var list = reply.TryGetValue(name, out found) ? found as List<object> : null;
        if (list == null || list.Count != count || list.Any(each => !(each is double))) throw new Unreadable("no " + name);
        var numbers = list.Cast<double>().ToArray();
        if (numbers.Any(each => Math.Abs(each) > 3.4028234663852886e38)) throw new Unreadable(name + " is out of range");
        return numbers;
    }

    static void Adopt(byte[] payload)
    {
        var reply = Text.Read(payload);
        var position = Numbers(reply, "position", 3);
        var q = Numbers(reply, "rotation", 4);
        if (Math.Abs(Math.Sqrt(q.Sum(each => each * each)) - 1) > 0.01) throw new Unreadable("no rotation");
        Console.WriteLine("the scene's camera is at " + string.Join(" ", position.Select(Spelled)));
    }

    // Until the connection ends: what comes is a reply if one is asked for, and ends it if it is none.
    static async Task Listen(Stream stream, SemaphoreSlim asked, SemaphoreSlim answered)
    {
        while (true)
        {
            var payload = await Packet(stream);
            if (!asked.Wait(0)) { Console.WriteLine("nobody asked"); continue; }
            Adopt(payload);
            answered.Release();
        }
    }

    static async Task Press(Stream stream, SemaphoreSlim asked, SemaphoreSlim answered)
    {
        bool first = true;
        while (true)
        {
            double until = Clock < 3 ? 3 - Clock : 0.3 + 1.2 * Fingers.NextDouble();
            await Task.Delay(TimeSpan.FromSeconds(until));
            if (first)
            {
                asked.Release();
                await Send(stream, "{\"cam_idx\": 0, \"type\": \"get_camera_pose\"}");
                if (!await answered.WaitAsync(TimeSpan.FromSeconds(8))) throw new IOException("no reply");
                first = false;
            }
            int key = Fingers.Next(6), held = Fingers.Next(4, 24);
            for (int i = 0; i < held; i++)
            {
                if (key < 3) place[key] += 0.05;
                else if (key == 3) place[2] -= 0.05;
                else yaw += key == 4 ? 0.02 : -0.02;
                await Send(stream, Pose());
                await Task.Delay(16);
            }
        }
    }

    static async Task Session()
    {
        using (var client = new TcpClient { NoDelay = true })
        {
            await client.ConnectAsync(Host, Port);
            var asked = new SemaphoreSlim(0);
            var answered = new SemaphoreSlim(0);
            await await Task.WhenAny(Listen(client.GetStream(), asked, answered), Press(client.GetStream(), asked, answered));
        }
    }

    static void Main()
    {
        TaskScheduler.UnobservedTaskException += (sender, e) => e.SetObserved();
        while (true)
        {
            try { Session().Wait(); }
            catch (AggregateException error) { Console.WriteLine(error.GetBaseException().Message); }
            Thread.Sleep(700);
        }
    }
}
