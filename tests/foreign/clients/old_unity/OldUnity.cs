// Unity's client without Unity: the script on the main thread, the plug-in on one of its own.
using System;
using System.Collections.Generic;
using System.Globalization;
using System.Net.Sockets;
using System.Runtime.InteropServices;
using System.Text;
using System.Threading;
using System.Text.RegularExpressions;

static class Wire
{
    public static TcpClient Connect(string variable)
    {
        var client = new TcpClient();
        client.Connect(Environment.GetEnvironmentVariable("SPLATBUS_HOST"),
            int.Parse(Environment.GetEnvironmentVariable(variable)));
        client.NoDelay = true;
        return client;
    }

    static byte[] Exactly(NetworkStream stream, int count)
    {
        var bytes = new byte[count];
        for (int have = 0; have < count;)
        {
            int got = stream.Read(bytes, have, count - have);
            if (got == 0) return null;
            have += got;
        }
        return bytes;
    }

    // Null at the end of the stream.
    public static string Read(NetworkStream stream)
    {
        byte[] header = Exactly(stream, 4);
        byte[] payload = header == null ? null : Exactly(stream, BitConverter.ToInt32(header, 0));
        return payload == null ? null : Encoding.UTF8.GetString(payload);
    }

    public static void Write(NetworkStream stream, string text)
    {
        byte[] payload = Encoding.UTF8.GetBytes(text);
        stream.Write(BitConverter.GetBytes(payload.Length), 0, 4);
        stream.Write(payload, 0, payload.Length);
    }
}

// JSON for those who trust their server: of equal names the last counts.
class Lenient
{
    static readonly Regex Tokens = new Regex("\\G\\s*(\"(?:[^\"\\\\]|\\\\.)*\"|[{}\\[\\]:,]|[^\\s{}\\[\\]:,\"]+)");
    readonly string text;
    int at;

    public Lenient(string text) { this.text = text; }

    string Token()
    {
        Match found = Tokens.Match(text, at);
        if (!found.Success) throw new FormatException("unexpected end of input at " + at);
        at += found.Length;
        return found.Groups[1].Value;
    }

    public object Value() { return Value(Token()); }

    object Value(string token)
    {
        if (token[0] == '"') return Regex.Unescape(token.Substring(1, token.Length - 2));
        if (token == "{")
        {
            var members = new Dictionary<string, object>();
            for (token = Token(); token != "}"; token = Token())
            {
                if (token == ",") continue;
                if (Token() != ":") throw new FormatException("no colon at " + at);
                members[(string)Value(token)] = Value();
            }
            return members;
        }
        if (token == "[")
        {
            var items = new List<object>();
            for (token = Token(); token != "]"; token = Token()) if (token != ",") items.Add(Value(token));
            return items;
        }
        if (token == "null") return null;
        return token == "true" || token == "false" ? token == "true" : (object)double.Parse(token, CultureInfo.InvariantCulture);
    }
}

unsafe struct Handle { public fixed byte Bytes[64]; }

unsafe class Plugin
{
    const string Cuda = "libcudart.so.12";
    [DllImport(Cuda)] static extern int cudaSetDevice(int device);
    [DllImport(Cuda)] static extern int cudaIpcOpenMemHandle(out IntPtr memory, Handle handle, uint flags);
    [DllImport(Cuda)] static extern int cudaIpcCloseMemHandle(IntPtr memory);
    [DllImport(Cuda)] static extern int cudaIpcOpenEventHandle(out IntPtr done, Handle handle);
    [DllImport(Cuda)] static extern int cudaEventDestroy(IntPtr done);
    [DllImport(Cuda)] static extern int cudaEventSynchronize(IntPtr done);
    [DllImport(Cuda)] static extern int cudaMemcpy2D(IntPtr to, UIntPtr toPitch, IntPtr from, UIntPtr fromPitch,
        UIntPtr width, UIntPtr height, int kind);

    int w, h, pitchColour, pitchDepth;
    long colourAt, depthAt;
    IntPtr colour, depth, done;
    byte[] pixels, distances;

    static Handle Key(object text)
    {
        byte[] bytes = Convert.FromBase64String((string)text);
        if (bytes.Length != 64) throw new FormatException("a handle of " + bytes.Length + " bytes");
        var handle = new Handle();
        for (int i = 0; i < 64; i++) handle.Bytes[i] = bytes[i];
        return handle;
    }

    static long Whole(IDictionary<string, object> of, string name, long otherwise)
    {
        return of.ContainsKey(name) ? Convert.ToInt64(of[name]) : otherwise;
    }

    bool Open(IDictionary<string, object> packet, IDictionary<string, object> meta)
    {
        w = (int)Whole(meta, "w", 0);
        h = (int)Whole(meta, "h", 0);
        pitchColour = (int)Whole(meta, "pitchColor", 0);
        pitchDepth = (int)Whole(meta, "pitchDepth", 0);
        colourAt = Whole(meta, "offsetColor", 0);
        depthAt = Whole(meta, "offsetDepth", 0);
        long device = Whole(meta, "device", 0);
        if (w < 1 || w > 32768 || h < 1 || h > 32768 || pitchColour != 16 * w || pitchDepth != 4 * w) return false;
        if (colourAt < 0 || colourAt % 16 != 0 || depthAt < 0 || depthAt % 4 != 0 || device < 0) return false;
        if (!"RGBA32F".Equals(meta["fmtColor"]) || !"R32F".Equals(meta["fmtDepth"])) return false;
        Handle ofColour = Key(packet["mem_color"]), ofDepth = Key(packet["mem_depth"]), ofDone = Key(packet["evt_done"]);
        if (cudaSetDevice((int)device) != 0 || cudaIpcOpenMemHandle(out colour, ofColour, 1) != 0) return false;
        if (packet["mem_color"].Equals(packet["mem_depth"])) depth = colour;
        else if (cudaIpcOpenMemHandle(out depth, ofDepth, 1) != 0) return false;
        if (cudaIpcOpenEventHandle(out done, ofDone) != 0) return false;
        pixels = new byte[16 * w * h];
        distances = new byte[4 * w * h];
        return true;
    }

    void Copy(byte[] to, IntPtr from, long offset, int pitch)
    {
        fixed (byte* start = to)
            cudaMemcpy2D((IntPtr)start, (UIntPtr)(uint)pitch, (IntPtr)(from.ToInt64() + offset), (UIntPtr)(uint)pitch,
                (UIntPtr)(uint)pitch, (UIntPtr)(uint)h, 2);
    }

    void Close()
    {
        if (depth != IntPtr.Zero && depth != colour) cudaIpcCloseMemHandle(depth);
        if (colour != IntPtr.Zero) cudaIpcCloseMemHandle(colour);
        if (done != IntPtr.Zero) cudaEventDestroy(done);
    }

    // One connection: the first init packet, then images until it ends; false if there was nothing to show.
    static bool Show(TcpClient client)
    {
        var stream = client.GetStream();
        for (string text; (text = Wire.Read(stream)) != null;)
        {
            var packet = (IDictionary<string, object>)new Lenient(text).Value();
            if (packet.ContainsKey("type") || !packet.ContainsKey("meta")) continue;
            var plugin = new Plugin();
            try
            {
                if (!plugin.Open(packet, (IDictionary<string, object>)packet["meta"])) return false;
                for (;;)
                {
                    while (!client.Client.Poll(20000, SelectMode.SelectRead))
                    {
                        cudaEventSynchronize(plugin.done);
                        plugin.Copy(plugin.pixels, plugin.colour, plugin.colourAt, plugin.pitchColour);
                        plugin.Copy(plugin.distances, plugin.depth, plugin.depthAt, plugin.pitchDepth);
                    }
                    if (Wire.Read(stream) == null) return true;
                }
            }
            finally { plugin.Close(); }
        }
        return true;
    }

    public static void Run()
    {
        for (;;)
        {
            bool showed = true;
            try { using (var client = Wire.Connect("SPLATBUS_IPC_PORT")) showed = Show(client); }
            catch (SocketException) { }
            catch (System.IO.IOException) { }
            if (showed) Thread.Sleep(500);
        }
    }
}

static class Scene
{
    static float[] Numbers(string reply, string name)
    {
        int at = reply.IndexOf("\"" + name + "\"", StringComparison.Ordinal);
        int open = reply.IndexOf('[', at), close = reply.IndexOf(']', open);
        return Array.ConvertAll(reply.Substring(open + 1, close - open - 1).Split(','),
            text => float.Parse(text, CultureInfo.InvariantCulture));
    }

    static void Main()
    {
        new Thread(Plugin.Run) { IsBackground = true }.Start();
        TcpClient client = null;
        while (client == null)
        {
            try { client = Wire.Connect("SPLATBUS_MSG_PORT"); }
            catch (SocketException) { Thread.Sleep(500); }
        }
        try { Steer(client.GetStream()); }
        catch (System.IO.IOException) { }
        client.Close();
        Thread.Sleep(Timeout.Infinite);
    }

    static void Steer(NetworkStream stream)
    {
        var clock = System.Diagnostics.Stopwatch.StartNew();
        Wire.Write(stream, "{\"type\":\"get_camera_pose\",\"cam_idx\":0}");
        string reply = Wire.Read(stream);
        if (reply == null) return;
        float[] centre = Numbers(reply, "position");
        Wire.Write(stream, "{\"type\":\"get_viewport_size\",\"timestamp\":" + Spelt((float)clock.Elapsed.TotalSeconds) + "}");
        reply = Wire.Read(stream);
        if (reply == null) return;
        string size = reply.Substring(reply.IndexOf('[') + 1, reply.IndexOf(']') - reply.IndexOf('[') - 1);
        foreach (string each in size.Split(',')) int.Parse(each, CultureInfo.InvariantCulture);
        for (float turn = 0; ; turn += 0.02f)
        {
            string begin = ",\"timestamp\":" + Spelt((float)clock.Elapsed.TotalSeconds) + ",\"position\":{\"x\":";
            Wire.Write(stream, "{\"type\":\"camera_pose\"" + begin + Spelt(centre[0] + (float)Math.Sin(turn))
                + ",\"y\":" + Spelt(centre[1]) + ",\"z\":" + Spelt(centre[2]) + "},\"rotation\":{\"x\":-0.0,\"y\":"
                + Spelt((float)Math.Sin(turn / 2)) + ",\"z\":-0.0,\"w\":" + Spelt((float)Math.Cos(turn / 2)) + "}}");
            Wire.Write(stream, "{\"type\":\"point_cloud_pose\"" + begin
                + "0.0,\"y\":-0.0,\"z\":0.0},\"rotation\":{\"x\":-0.0,\"y\":0.0,\"z\":-0.0,\"w\":1.0}}");
            Thread.Sleep(20);
            if (stream.DataAvailable && Wire.Read(stream) == null) return;
        }
    }

    static string Spelt(double value) { return value.ToString("R", CultureInfo.InvariantCulture); }
}
